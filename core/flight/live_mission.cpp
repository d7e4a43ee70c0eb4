#include "core/flight/live_mission.hpp"

#include <algorithm>
#include <utility>

#include "core/flight/known_tags.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/types/live_limits.hpp"

namespace anchord::flight {
namespace {

constexpr std::size_t k_rate_rows = 100;         // the range rate is that of the newest so many
constexpr std::size_t k_min_joint_ranges = 100;  // below, the own search of each anchor is as good
constexpr double k_same_origin_m = 1e-3;

}  // namespace

std::string_view anchor_status(const Estimate& estimate) {
  if (!estimate.best) return "found";
  if (reached_goal(estimate)) return "converged";
  if (estimate.verdict == Verdict::ambiguous) return "ambiguous";
  return "estimating";
}

LiveMission::LiveMission(LiveMissionSetup setup)
    : setup_(std::move(setup)), live_(setup_.mission, setup_.live) {
  state_.time = setup_.mission.created;
}

void LiveMission::add(const LiveRow& row) {
  const UtcTime time = time_of(row);
  if (!state_.started || time < *state_.started) state_.started = time;
  if (!(time < state_.time) || state_.n_ranges + state_.n_fixes == 0) state_.time = time;
  std::visit([this](const auto& one) { add(one); }, row);
}

void LiveMission::add(const PredictedRange& judged) {
  const Range& range = judged.range;
  ++state_.n_ranges;
  range_times_us_.push_back(range.time.us());
  if (range_times_us_.size() > k_rate_rows) range_times_us_.pop_front();
  const double span_s = static_cast<double>(range_times_us_.back() - range_times_us_.front()) * 1e-6;
  state_.range_rate_hz = span_s > 0 ? static_cast<double>(range_times_us_.size() - 1) / span_s : 0;
  if (!follows(range)) return;
  watch_.note_range(range.time, range.received);
  if (excluded(setup_.exclusions, range)) return live_.leave_out(range);
  if (judged.model)
    watch_.note_model(judged.model->withheld);
  else if (judged.silent)
    watch_.note_model("ranges lack what they need (levels, or an impulse response)");
  history_.add(corrected(judged), error_model_of(judged));
  ++ranges_since_joint_;
  live_.add(range, judged.model);
}

bool LiveMission::follows(const Range& range) {
  const auto has_place = [](std::set<NetworkId>& known, NetworkId id, std::size_t most) {
    return known.contains(id) || (known.size() < most && known.insert(id).second);
  };
  const bool tag = range.kind == RangeKind::tag_anchor;
  return has_place(tag ? tags_ : anchors_, range.tag, tag ? k_most_live_tags : k_most_live_anchors) &&
         has_place(anchors_, range.anchor, k_most_live_anchors);
}

void LiveMission::add(const Fix& fix) {
  ++state_.n_fixes;
  watch_.note(fix);
  if (excluded(setup_.exclusions, fix)) {
    ++state_.n_fixes_excluded;
  } else {
    history_.add(fix);
    live_.add(fix);
  }
}

void LiveMission::use_priors(procedure::FlightPriors priors) {
  setup_.priors = std::move(priors);
  priors_in_use_ = false;
  if (history_.n_ranges() > 0) ++ranges_since_joint_;  // worth another joint solution
  update_live_priors();
}

void LiveMission::use_targets(PlanTargets targets) {
  if (targets == setup_.targets) return;
  setup_.targets = std::move(targets);
  if (reading_) return;  // every anchor is announced at its end
  for (auto& estimate : live_.estimates()) announce_estimate(std::move(estimate));
}

void LiveMission::assess(Estimate& estimate) const {
  assess_goal(estimate, anchor_goal(estimate.anchor, {&setup_.targets, 1}, setup_.goal));
}

/// Before the first good fix there is no frame to give them in.
void LiveMission::update_live_priors() {
  const auto origin = live_.origin();
  if (priors_in_use_ || !origin) return;
  live_.set_priors(priors_in(setup_.priors, EnuFrame(*origin)));
  priors_in_use_ = true;
}

void LiveMission::settle() {
  update_live_priors();
  for (auto& result : live_.take_ranges()) {
    if (result.refused == "unknown_tag")
      watch_.note_unknown_tag(result.range.tag, result.range.time, tags_text(setup_.mission));
    if (!reading_) events_.emplace_back(RangeDecided{std::move(result)});
  }
  for (auto& estimate : live_.take_estimates()) announce_estimate(std::move(estimate));
  announce_fixes();
  state_.anchors_found = statuses_.size();
  state_.anchors_converged = static_cast<std::size_t>(
      std::ranges::count_if(statuses_, [](const auto& one) { return one.second == "converged"; }));
}

void LiveMission::announce_estimate(Estimate estimate) {
  assess(estimate);
  const auto status = anchor_status(estimate);
  const auto [known, is_new] = statuses_.try_emplace(estimate.anchor, status);
  const bool changed = is_new || known->second != status;
  known->second = status;
  if (is_new) events_.emplace_back(AnchorFound{estimate.anchor, !reading_});
  if (changed && !reading_ && (status == "converged" || status == "ambiguous"))
    events_.emplace_back(AnchorStatusChanged{estimate.anchor, status, estimate.reason});
  const auto shift = live_.model_shift(estimate.anchor);
  const auto moved_m = shift ? std::optional(shift->m) : std::nullopt;
  watch_.note_moved(estimate.anchor, moved_m, shift ? shift->known_to_m : 0);
  events_.emplace_back(AnchorEstimated{std::move(estimate), moved_m});
}

/// The first rejection of each reason is an event, and so is an origin that turned out to be none.
void LiveMission::announce_fixes() {
  state_.fixes_refused = live_.fixes_refused();
  if (state_.n_fixes_excluded > 0) state_.fixes_refused["excluded"] = state_.n_fixes_excluded;
  for (const auto& [reason, n] : state_.fixes_refused) {
    if (reason == "not_usable" || !rejections_published_.try_emplace(reason, n).second) continue;
    if (!reading_) events_.emplace_back(FixRejected{reason});
  }
  const auto origin = live_.origin();
  const auto& before = state_.origin;
  if (before && origin && EnuFrame(*before).enu_from_wgs84(*origin).m.norm() > k_same_origin_m) {
    priors_in_use_ = false;
    if (!reading_) events_.emplace_back(OriginMoved{});
  }
  state_.origin = origin;
}

void LiveMission::begin_reading() {
  reading_ = true;
  live_.hold(true);
}

void LiveMission::end_reading() {
  update_live_priors();
  live_.hold(false);
  settle();
  reading_ = false;
}

void LiveMission::begin_anew(std::vector<Exclusion> exclusions) {
  ++generation_;
  setup_.exclusions = std::move(exclusions);
  live_ = LiveFlight(setup_.mission, setup_.live);
  history_.clear();
  tags_.clear();
  anchors_.clear();
  rejections_published_.clear();
  priors_in_use_ = false;
  ranges_since_joint_ = 0;
  range_times_us_.clear();
  const UtcTime newest = state_.time;
  state_ = {};
  state_.time = newest;
}

bool LiveMission::joint_is_worth_it() const {
  return ranges_since_joint_ > 0 && history_.n_ranges() >= k_min_joint_ranges &&
         (setup_.mission.frame != TrackFrame::wgs84 || live_.origin());
}

LiveMission::JointProblem LiveMission::joint_problem(std::vector<Eigen::Vector2d> outline_m) {
  JointProblem out;
  out.options.origin = live_.origin();
  if (const auto& origin = out.options.origin)
    out.options.priors = priors_in(setup_.priors, EnuFrame(*origin));
  out.options.outline_m = std::move(outline_m);
  out.options.track = setup_.live.track;
  out.flight = history_.data(setup_.mission);
  out.cut = history_.newest();
  out.generation = generation_;
  ranges_since_joint_ = 0;
  return out;
}

bool LiveMission::adopt(const FlightSolution& solution, UtcTime cut, std::uint64_t generation) {
  if (generation != generation_) return false;
  live_.adopt(solution, cut);
  watch_.note_lag(solution.shared.lag_s.value, solution.shared.lag_s.sigma);
  settle();
  return true;
}

std::vector<Estimate> LiveMission::estimates() const {
  auto out = live_.estimates();
  for (auto& estimate : out) assess(estimate);
  return out;
}

}  // namespace anchord::flight
