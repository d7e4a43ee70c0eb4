#include "core/localize/flight_rows.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/base/median.hpp"
#include "core/geo/track_check.hpp"

namespace anchord {
namespace {

constexpr double k_arm_across_m = 0.01;
constexpr double k_still_s = 30, k_still_rad = 1e-4;

/// Word under which a range is refused before any geometry, or empty.
std::string refusal(const FlightRange& range, const FlightOptions& options) {
  if (!std::isfinite(range.distance_m)) return "not_finite";
  if (range.distance_m == 0.0) return "zero_range";  // the device's failure value
  if (range.distance_m < options.min_range_m || range.distance_m > options.max_range_m)
    return "out_of_bounds";
  return {};
}

std::optional<Eigen::Vector3d> lever_arm(const Mission& mission, const FlightRange& range) {
  for (const auto& antenna : mission.tags) {
    if (antenna.tag == range.tag && antenna.antenna == range.antenna) return antenna.lever_arm_body_m;
  }
  if (mission.tags.empty()) return Eigen::Vector3d::Zero();
  return std::nullopt;
}

/// Each antenna its own vertical arm, where there is more than one; beyond four the rest share the common.
void name_arms(FlightRows& rows) {
  std::map<std::pair<NetworkId, std::uint8_t>, int> arms;
  for (const AnchorRows& anchor : rows.anchors) {
    for (const JointRow& row : anchor.rows) arms.try_emplace({row.tag, row.antenna}, 0);
  }
  int next = 0;
  for (auto& [antenna, arm] : arms) {
    arm = next++;
    rows.antennas.push_back({antenna.first, antenna.second});
  }
  if (arms.size() < 2) return;
  for (AnchorRows& anchor : rows.anchors) {
    for (JointRow& row : anchor.rows) {
      const int arm = arms.at({row.tag, row.antenna});
      if (arm < k_most_antennas) row.arm = static_cast<std::int8_t>(arm);
    }
  }
}

/// Where the metres of the rows begin; nothing in a local frame.
Result<std::optional<EnuFrame>> frame_of(const std::optional<Wgs84>& centre, const FlightOptions& options) {
  if (!centre) return std::optional<EnuFrame>{};
  const EnuFrame frame(options.origin.value_or(*centre));
  // Swapped coordinates, or the origin of another site.
  const double far_m = frame.enu_from_wgs84(*centre).m.norm();
  if (far_m > options.track.max_distance_m)
    return make_error(Errc::too_few_observations,
                      "the middle of the track is " + std::to_string(std::llround(far_m / 1000)) +
                          " km from the origin, more than the " +
                          std::to_string(std::llround(options.track.max_distance_m / 1000)) +
                          " km allowed: check the site's origin");
  return std::optional(frame);
}

bool has_arm_across(const FlightData& flight) {
  return std::ranges::any_of(flight.mission.tags, [](const auto& tag) {
    return tag.lever_arm_body_m.template head<2>().norm() > k_arm_across_m;
  });
}

/// Does the heading stay the same to the last digit, as no compass has it? Where one stands still so, the
/// aircraft may have turned all the same.
bool heading_stands_still(const std::vector<Fix>& fixes) {
  if (fixes.empty() || seconds_between(fixes.front().time, fixes.back().time) < k_still_s) return false;
  const auto forward = [](const Fix& fix) -> Eigen::Vector2d {
    return (*fix.enu_from_body * Eigen::Vector3d::UnitX()).head<2>().normalized();
  };
  return std::ranges::all_of(fixes, [&](const Fix& fix) {
    return fix.enu_from_body && (forward(fix) - forward(fixes.front())).norm() < k_still_rad;
  });
}

/// A heading that stands still is not taken for one, where an arm would be turned by it.
void drop_still_heading(const FlightData& flight, std::vector<Fix>& fixes, std::vector<std::string>& notes) {
  if (!has_arm_across(flight) || !heading_stands_still(fixes)) return;
  for (Fix& fix : fixes) fix.enu_from_body.reset();
  notes.emplace_back(
      "the heading of the track is the same in all positions, to the last digit: it is taken as not "
      "measured");
}

void note_track(const FlightData& flight, const std::vector<std::string>& notes, FlightRows& rows) {
  if (has_arm_across(flight) && !rows.track.has_attitude()) {
    rows.notes.emplace_back("the track has no attitude: only the upward part of the lever arms is applied");
  }
  rows.notes.insert(rows.notes.end(), notes.begin(), notes.end());
  if (flight.n_fixes_excluded > 0) {
    rows.fixes_refused["excluded"] = flight.n_fixes_excluded;
    rows.notes.push_back(std::to_string(flight.n_fixes_excluded) + " positions were excluded by a person");
  }
}

using Between = std::map<std::pair<NetworkId, NetworkId>, std::vector<double>>;

/// Of the ranges at `usable` those that repeat no earlier one: same time, radios, antenna and number. The
/// first of each stays; in order.
std::vector<std::size_t> without_repeats(const FlightData& flight, std::vector<std::size_t> usable) {
  const auto identity = [&](std::size_t i) {
    const FlightRange r = flight.range(i);
    return std::tuple(r.time.ns, r.tag, r.antenna, r.anchor, r.seq);
  };
  std::ranges::stable_sort(usable, {}, identity);
  const auto [from, to] = std::ranges::unique(usable, {}, identity);
  usable.erase(from, to);
  std::ranges::sort(usable);
  return usable;
}

/// Ranges of the tags into `rows`, by anchor; those between anchors into what is returned.
Between add_ranges(const FlightData& flight, const FlightOptions& options, FlightRows& rows) {
  std::map<NetworkId, AnchorRows> anchors;
  std::vector<std::size_t> usable;
  Between between;
  for (std::size_t i = 0; i < flight.n_ranges(); ++i) {
    const FlightRange range = flight.range(i);
    if (range.kind == RangeKind::anchor_anchor) {
      if (refusal(range, options).empty() && range.tag != range.anchor)
        between[std::minmax(range.tag, range.anchor)].push_back(range.distance_m);
      continue;
    }
    AnchorRows& anchor = anchors[range.anchor];
    std::string why = refusal(range, options);
    if (why.empty() && !lever_arm(flight.mission, range)) why = "unknown_tag";
    if (why.empty())
      usable.push_back(i);
    else
      ++anchor.refused[why];
  }
  std::map<NetworkId, std::size_t> n_usable, n_kept;
  for (const std::size_t i : usable) ++n_usable[flight.range(i).anchor];
  const auto kept = without_repeats(flight, std::move(usable));
  for (const std::size_t i : kept) ++n_kept[flight.range(i).anchor];
  for (const auto& [id, n] : n_usable) {
    anchors[id].rows.reserve(n_kept[id]);
    if (n > n_kept[id]) anchors[id].refused["duplicate"] = n - n_kept[id];
  }
  for (const std::size_t i : kept) {
    const FlightRange range = flight.range(i);
    auto& own = anchors[range.anchor].rows;
    own.push_back({.t_s = seconds_between(rows.epoch, range.time),
                   .distance_m = range.distance_m,
                   .lever_arm_body_m = lever_arm(flight.mission, range).value(),
                   .tag = range.tag,
                   .antenna = range.antenna,
                   .rss_dbm = range.rss_dbm,
                   .received_m = i < flight.received_m.size() ? flight.received_m[i] : range.distance_m});
    if (i < flight.error_models.size() && flight.error_models[i])
      own.back().error_model = &*flight.error_models[i];
  }
  for (const auto& [id, n] : flight.n_ranges_excluded) anchors[id].refused["excluded"] += n;
  for (auto& [id, anchor] : anchors) {
    anchor.id = id;
    const auto name = flight.anchor_names.find(id);
    anchor.name = name != flight.anchor_names.end() ? name->second : to_string(id);
    std::ranges::stable_sort(anchor.rows, {}, &JointRow::t_s);
    rows.anchors.push_back(std::move(anchor));
  }
  return between;
}

void add_pairs(Between between, const FlightOptions& options, FlightRows& rows) {
  for (auto& [ids, distances_m] : between) {
    const auto a = std::ranges::find(rows.anchors, ids.first, &AnchorRows::id);
    const auto b = std::ranges::find(rows.anchors, ids.second, &AnchorRows::id);
    if (a == rows.anchors.end() || b == rows.anchors.end()) continue;
    PairRow pair{static_cast<std::size_t>(a - rows.anchors.begin()),
                 static_cast<std::size_t>(b - rows.anchors.begin()), upper_median(distances_m),
                 options.pair_sigma_m, distances_m.size()};
    for (double& d : distances_m) d = std::abs(d - pair.distance_m);
    pair.sigma_m = std::max(pair.sigma_m, 1.4826 * upper_median(distances_m));
    rows.pairs.push_back(pair);
  }
}

}  // namespace

Result<FlightRows> flight_rows(const FlightData& flight, const FlightOptions& options) {
  const TrackFrame kind = flight.mission.frame;
  auto checked = check_track(flight.fixes, kind, options.min_fix, options.track);
  auto& fixes = checked.fixes;
  if (fixes.empty()) return make_error(Errc::too_few_observations, "no usable position in the track");
  if (flight.n_ranges() == 0) return make_error(Errc::too_few_observations, "no ranges");
  BOOST_OUTCOME_TRY(const auto frame,
                    frame_of(kind == TrackFrame::wgs84 ? checked.centre : std::nullopt, options));
  drop_still_heading(flight, fixes, checked.notes);
  const UtcTime epoch = fixes.front().time;
  FlightRows rows{epoch,
                  frame,
                  TagTrack(fixes, frame, epoch, {options.min_fix, options.max_gap_s}),
                  {},
                  {},
                  {},
                  0,
                  std::move(checked.refused),
                  {},
                  flight.mission.point,
                  checked.step_share};
  rows.track_span_s = rows.track.poses().back().t_s - rows.track.poses().front().t_s;
  note_track(flight, checked.notes, rows);
  Between between = add_ranges(flight, options, rows);
  name_arms(rows);
  add_pairs(std::move(between), options, rows);
  return rows;
}

}  // namespace anchord
