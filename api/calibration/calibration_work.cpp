// Tasks, answers and orders of calibrations as text. Types are taken apart by structured bindings: who adds a
// member to one of them is sent here by the compiler.
#include "api/calibration/calibration_work.hpp"

#include <algorithm>

#include "api/work/packed_text.hpp"
#include "api/work/packing.hpp"

namespace anchord {
namespace ml {
constexpr const auto& packed_words(Correction) { return k_correction_words; }
}  // namespace ml

inline constexpr auto k_packed_dims = enum_table<Dims>({{"2", Dims::two}, {"3", Dims::three}});
constexpr const auto& packed_words(Dims) { return k_packed_dims; }
constexpr const auto& packed_words(Method) { return k_solver_words; }
constexpr const auto& packed_words(Weights) { return k_weights_words; }
constexpr const auto& packed_words(Loss) { return k_loss_words; }
constexpr const auto& packed_words(FixClass) { return k_fix_words; }
constexpr const auto& packed_words(TrackFrame) { return k_frame_words; }
constexpr const auto& packed_words(TrackPoint) { return k_point_words; }
constexpr const auto& packed_words(RangeKind) { return k_range_kind_words; }
constexpr const auto& packed_words(Verdict) { return k_verdict_words; }
}  // namespace anchord

namespace anchord::api {
namespace {

constexpr std::string_view k_mark = R"({"kind":"calibration"})";
constexpr std::size_t k_most_flights = 200, k_most_kits = 200, k_most_anchors = 10'000, k_most_notes = 1000,
                      k_most_reasons = 200, k_most_gates = 64, k_most_residuals = 500, k_most_track = 400,
                      k_most_steps = 50, k_most_factors = 10'000, k_most_corners = 100'000,
                      k_most_antennas = 1000;
constexpr std::size_t k_answer_of_anchor = 150'000, k_answer_of_flight = std::size_t{1} << 20;

}  // namespace

// ---- Plain values.

template <class P>
void fields(P& p, Packed<P, Wgs84>& v) {
  auto& [lat_deg, lon_deg, height_m] = v;
  p(lat_deg, lon_deg, height_m);
}
template <class P>
void fields(P& p, Packed<P, Valued>& v) {
  auto& [value, sigma] = v;
  p.loose(value);
  p.loose(sigma);
}
/// A place for which the kept form has null where a number is none.
template <class P, class M>
void loose(P& p, M& place) {
  for (Eigen::Index i = 0; i < place.size(); ++i) p.loose(place.data()[i]);
}

// ---- The task.

template <class P>
void fields(P& p, Packed<P, TagAntenna>& v) {
  auto& [tag, antenna, lever_arm_body_m] = v;
  p(tag, antenna, lever_arm_body_m);
}
/// As far as a solve looks at it.
template <class P>
void fields(P& p, Packed<P, Mission>& v) {
  auto& [id, site, name, kit, radio, frame, point, tags, lever_arm_sigma_m, state, created, finished] = v;
  p(id, name, kit, frame, point, lever_arm_sigma_m);
  p.list(tags, k_most_antennas);
  (void)site, (void)radio, (void)state, (void)created, (void)finished;
}
template <class P>
void fields(P& p, Packed<P, RangeErrorModel>& v) {
  auto& [p_los, los_bias_m, los_sigma_m, nlos_bias_m, nlos_sigma_m, nlos_tail_m] = v;
  p(p_los, los_bias_m, los_sigma_m, nlos_bias_m, nlos_sigma_m, nlos_tail_m);
}
template <class P>
void fields(P& p, Packed<P, std::optional<Eigen::Quaterniond>>& v) {
  bool there = v.has_value();
  p(there);
  if constexpr (P::k_reads) {
    v.reset();
    if (there) v.emplace();
  }
  if (v) p(v->coeffs());
}

/// Times lie close to each other: what they differ by compresses.
struct TimeColumn {
  std::int64_t before{0};
  template <class P, class Row>
  void operator()(P& p, Row& row) {
    // Differences wrap around, as they do back: no time is out of reach.
    auto differs = static_cast<std::uint64_t>(row.time.ns) - static_cast<std::uint64_t>(before);
    p(differs);
    if constexpr (P::k_reads)
      row.time.ns = static_cast<std::int64_t>(static_cast<std::uint64_t>(before) + differs);
    before = row.time.ns;
  }
};
template <class M>
auto column(M member) {
  return [member](auto& p, auto& row) { p(row.*member); };
}

template <class P>
void pack_fixes(P& p, Packed<P, std::vector<Fix>>& fixes) {
  p.columns(
      fixes, TimeColumn{}, column(&Fix::received), column(&Fix::seq), column(&Fix::frame),
      [](auto& q, auto& f) { q(f.position.lat_deg); }, [](auto& q, auto& f) { q(f.position.lon_deg); },
      [](auto& q, auto& f) { q(f.position.height_m); }, column(&Fix::local_m), column(&Fix::fix),
      column(&Fix::covariance_m2), [](auto& q, auto& f) { fields(q, f.enu_from_body); },
      column(&Fix::correction_age_s), column(&Fix::satellites));
}
template <class P>
void pack_rows(P& p, Packed<P, std::vector<FlightRange>>& rows) {
  using R = FlightRange;
  p.columns(rows, TimeColumn{}, column(&R::distance_m), column(&R::seq), column(&R::rss_dbm), column(&R::tag),
            column(&R::anchor), column(&R::antenna), column(&R::kind));
}
/// What a solve looks at; its ranges are kept as rows.
template <class P>
void fields(P& p, Packed<P, FlightData>& v) {
  auto& [mission, fixes, ranges, rows, anchor_names, error_models, received_m, n_ranges_excluded,
         n_fixes_excluded, exclusions, notes] = v;
  p(mission, n_fixes_excluded);
  pack_fixes(p, fixes);
  pack_rows(p, rows);
  const auto whole = [](auto& q, auto& value) { q(value); };
  p.columns(error_models, whole);
  p.columns(received_m, whole);
  p.map(n_ranges_excluded, k_most_anchors);
  p.map(anchor_names, k_most_anchors);
  p.list(notes, k_most_notes);
  (void)ranges, (void)exclusions;
}
template <class P>
void fields(P& p, Packed<P, ProfileFactor>& v) {
  auto& [flight, digest, information, information_mean] = v;
  p(flight, digest, information, information_mean);
}
template <class P>
void fields(P& p, Packed<P, KitProfile>& v) {
  auto& [kit, factors] = v;
  p(kit);
  p.list(factors, k_most_factors);
}
template <class P>
void fields(P& p, Packed<P, AnchorPriors::Bearing>& v) {
  auto& [tag_m, bearing_rad, sigma_rad] = v;
  p(tag_m, bearing_rad, sigma_rad);
}
template <class P>
void fields(P& p, Packed<P, AnchorPriors::Height>& v) {
  auto& [up_m, sigma_m] = v;
  p(up_m, sigma_m);
}
template <class P>
void fields(P& p, Packed<P, AnchorPriors>& v) {
  auto& [bearing, height] = v;
  p(bearing, height);
}
template <class P>
void fields(P& p, Packed<P, FlightOptions::HeightPrior>& v) {
  auto& [height_m, sigma_m] = v;
  p(height_m, sigma_m);
}
template <class P>
void fields(P& p, Packed<P, TrackLimits>& v) {
  auto& [speed, acceleration, age, pause, ahead, disorder, distance, step_share] = v;
  p(speed, acceleration, age, pause, ahead, disorder, distance, step_share);
}
template <class P>
void fields(P& p, Packed<P, FlightOptions>& v) {
  auto& [dims, method, weights, loss, anchor_height_m, anchor_height_sigma_m, height_prior, min_fix, track,
         max_gap_s, min_range_m, max_range_m, bias_prior_m, calibrated_bias_prior_m, bias_gate_z,
         bias_known_sigma_m, unknown_bias_prior_m, delay_prior_m, curve_prior_m, lag_prior_s, lever_prior_m,
         lever_across_prior_m, lever_arm_sigma_m, pair_sigma_m, pair_bias_prior_m, fixed_bias_m, mad_factor,
         min_scale_m, correlation_s, floor_sigma_m, priors, outline_m, outline_sigma_m, starts,
         start_at_priors, level_sigma_db, origin, profile, canceled] = v;
  p(dims, method, weights, loss, anchor_height_m, anchor_height_sigma_m, height_prior, min_fix, track,
    max_gap_s, min_range_m, max_range_m, bias_prior_m, calibrated_bias_prior_m, bias_gate_z,
    bias_known_sigma_m, unknown_bias_prior_m, delay_prior_m, curve_prior_m, lag_prior_s, lever_prior_m,
    lever_across_prior_m, lever_arm_sigma_m, pair_sigma_m, pair_bias_prior_m, fixed_bias_m, mad_factor,
    min_scale_m, correlation_s, floor_sigma_m, outline_sigma_m, start_at_priors, level_sigma_db, origin,
    profile);
  p.map(priors, k_most_anchors);
  p.list(outline_m, k_most_corners);
  p.map(starts, k_most_anchors);
  (void)canceled;
}
template <class P>
void fields(P& p, Packed<P, CalibrationTask::Kit>& v) {
  auto& [name, profile, priors] = v;
  p(name, profile);
  p.map(priors, k_most_anchors);
}
template <class P>
void fields(P& p, Packed<P, CorrectionWorth>& v) {
  auto& [n_ranges, n_blocks, gain, sigma, shown] = v;
  p(n_ranges, n_blocks, gain, sigma, shown);
}
template <class P>
void fields(P& p, Packed<P, FlightModelsReport>& v) {
  auto& [n_ranges, n_los, n_nlos, n_corrected, n_silent, n_believed, mean_correction_m, note, worth, used] =
      v;
  p(n_ranges, n_los, n_nlos, n_corrected, n_silent, n_believed, mean_correction_m, note, worth, used);
}
template <class P>
void fields(P& p, Packed<P, CalibrationTask>& v) {
  auto& [flights, n_answered, options, kits, use_profile, iterations, models, compare_uncorrected,
         ask_worth] = v;
  p(n_answered, options, use_profile, iterations, compare_uncorrected, ask_worth);
  p.list(flights, k_most_flights);
  p.list(kits, k_most_kits);
  p.list(models, k_most_flights);
}

// ---- The answer.

template <class P>
void fields(P& p, Packed<P, Gate>& v) {
  auto& [name, value, limit, passed, why] = v;
  p(name, value, limit, passed, why);
}
/// Its place on the globe is the server's to say.
template <class P>
void fields(P& p, Packed<P, Hypothesis>& v) {
  auto& [position, wgs84, covariance_m2, rms_residual_m, probability] = v;
  p(position.m, covariance_m2, rms_residual_m, probability);
  (void)wgs84;
}
template <class P>
void fields(P& p, Packed<P, Estimate>& v) {
  auto& [anchor, time, verdict, reason, best, mirror, h95_m, v95_m, gdop, gdop_trace, n_used, refused, bias_m,
         bias_sigma_m, lag_s, lag_sigma_s, largest_part, gates] = v;
  p(anchor);
  p.at("estimate of " + to_string(anchor));
  p(time, verdict, reason, best, mirror, h95_m, v95_m, gdop, gdop_trace, n_used, bias_m, bias_sigma_m, lag_s,
    lag_sigma_s, largest_part);
  p.map(refused, k_most_reasons);
  p.list(gates, k_most_gates);
}
template <class P>
void fields(P& p, Packed<P, ErrorBudget>& v) {
  auto& [parts_m2, weak] = v;
  for (auto& part : parts_m2) p(part);
  p(weak);
}
template <class P>
void fields(P& p, Packed<P, FlightAnswer::Anchor>& v) {
  auto& [estimate, budget] = v;
  p(estimate, budget);
}
template <class P>
void fields(P& p, Packed<P, SharedSolution::AntennaArm>& v) {
  auto& [tag, antenna, up_m] = v;
  p(tag, antenna, up_m);
}
template <class P>
void fields(P& p, Packed<P, SharedSolution>& v) {
  auto& [bias_m, curve_m, lag_s, lever_up_m, by_antenna, forward_m, left_m, arm_sigma_m, range_scale,
         range_scale_z, bias_determined, bias_z] = v;
  p(bias_m, curve_m, lag_s, lever_up_m, forward_m, left_m, arm_sigma_m, range_scale, bias_determined);
  p.list(by_antenna, k_most_antennas);
  p.loose(range_scale_z);
  p.loose(bias_z);
}
template <class P>
void fields(P& p, Packed<P, RangeResidual>& v) {
  auto& [time, tag, antenna, tag_m, distance_m, corrected_m, sigma_m, residual_m, standardised, weight,
         p_los] = v;
  p(time, tag, antenna, p_los);
  loose(p, tag_m);
  for (auto* one : {&distance_m, &corrected_m, &sigma_m, &residual_m, &standardised, &weight}) p.loose(*one);
}
/// Its name and kit are the server's to say.
template <class P>
void fields(P& p, Packed<P, FlightEvidence>& v) {
  auto& [name, kit, shared, n_fixes, n_ranges, n_used, refused, notes, track_m, residuals, observations] = v;
  p.at("evidence of a flight");
  p(shared, n_fixes, n_ranges, n_used, observations);
  p.map(refused, k_most_reasons);
  p.list(notes, k_most_notes);
  p.list(track_m, k_most_track);
  std::uint64_t n = residuals.size();
  p(n);
  auto known = residuals.begin();
  for (std::uint64_t i = 0; i < n; ++i) {
    if constexpr (P::k_reads) {
      NetworkId id{};
      p(id);
      if (p.faulty()) return;
      p.list(residuals[id], k_most_residuals);
    } else {
      p(known->first);
      p.list(known->second, k_most_residuals);
      ++known;
    }
  }
  (void)name, (void)kit, (void)known;
}
template <class P>
void fields(P& p, Packed<P, CorrectedRange>& v) {
  auto& [tag_m, distance_m, corrected_m] = v;
  loose(p, tag_m);
  p.loose(distance_m);
  p.loose(corrected_m);
}
template <class P>
void fields(P& p, Packed<P, ConvergenceStep>& v) {
  auto& [share, n_ranges, raw_m, corrected_m, h95_m, verdict, middle, n_los, n_nlos] = v;
  p(share, n_ranges, raw_m, corrected_m, verdict, middle, n_los, n_nlos);
  p.loose(h95_m);
}
template <class P>
void fields(P& p, Packed<P, FlightAnswer>& v) {
  auto& [anchors, uncorrected, evidence, fixes_refused, copy_of] = v;
  p.list(anchors, k_most_anchors);
  p.list(uncorrected, k_most_anchors);
  p(evidence);
  p.map(fixes_refused, k_most_reasons);
  p(copy_of);
}

namespace {

/// Of a map of lists.
template <class P>
void pack_course(P& p, Packed<P, Convergence>& course) {
  p.at("course of the estimates");
  std::vector<NetworkId> ids;
  for (const auto& [id, steps] : course) ids.push_back(id);
  p.list(ids, k_most_anchors);
  for (const NetworkId id : ids) {
    if constexpr (P::k_reads)
      p.list(course[id], k_most_steps);
    else
      p.list(course.at(id), k_most_steps);
  }
}

}  // namespace

template <class P>
void fields(P& p, Packed<P, CalibrationAnswer>& v) {
  auto& [flights, learned, models, course] = v;
  p.list(flights, k_most_flights);
  p.at("profiles of kits");
  p.list(learned, k_most_kits);
  p.at("models");
  p.list(models, k_most_flights);
  pack_course(p, course);
  p.at("end");
}

// ---- The order.

template <class P>
void fields(P& p, Packed<P, CalibrationOrder::Flight>& v) {
  auto& [id, name, kit, exclusions, declared, n_fixes, n_ranges, n_anchor_anchor, anchors] = v;
  p(id, name, kit, exclusions, declared, n_fixes, n_ranges, n_anchor_anchor);
  p.list(anchors, k_most_anchors);
}
template <class P>
void fields(P& p, Packed<P, CalibrationOrder::Kit>& v) {
  auto& [name, version, n_flights] = v;
  p(name, version, n_flights);
}
template <class P>
void fields(P& p, Packed<P, StatedNoise>& v) {
  auto& [los_m, nlos_m] = v;
  p(los_m, nlos_m);
}
template <class P>
void fields(P& p, Packed<P, LocalFrame>& v) {
  auto& [id, name, site, definition, created, version] = v;
  p(id, name, definition.text, created, version);
  (void)site;
}
template <class P>
void fields(P& p, Packed<P, CalibrationOrder>& v) {
  auto& [flights, n_answered, settings_json, frame, origin, kits, use_profile, teaches, compare_uncorrected,
         ask_worth, plane, iterations, n_priors, noise, floor_sigma_m, local_frame, base_json, outline_json,
         base_sigma_m, models, correction, reports] = v;
  p(n_answered, settings_json, frame, origin, use_profile, teaches, compare_uncorrected, ask_worth, plane,
    iterations, n_priors, noise, floor_sigma_m, local_frame, base_json, outline_json, base_sigma_m,
    correction);
  p.list(flights, k_most_flights);
  p.list(kits, k_most_kits);
  p.map(models, k_most_kits);
  p.list(reports, k_most_flights);
}

namespace {

template <class T>
std::string packed(const T& value) {
  Packer packer;
  packer(value);
  return packed_text(packer.take());
}

template <class T>
Result<T> unpacked(std::string_view text, std::size_t most, bool finite) {
  BOOST_OUTCOME_TRY(const auto bytes, from_packed_text(text, most));
  Unpacker unpacker(bytes, finite);
  T value;
  unpacker(value);
  BOOST_OUTCOME_TRYV(unpacker.done());
  return value;
}

}  // namespace

std::string calibration_message(const CalibrationTask& task) {
  return std::string(k_mark) + '\n' + packed(task);
}

bool is_calibration_work(std::string_view message) { return message.starts_with(k_mark); }

Result<CalibrationTask> read_task(std::string_view message) {
  constexpr std::size_t k_most = std::size_t{2} << 30;
  if (!is_calibration_work(message)) return make_error(Errc::bad_frame, "the message is of no calibration");
  return unpacked<CalibrationTask>(message.substr(std::min(message.size(), k_mark.size() + 1)), k_most,
                                   false);
}

Result<std::string> do_calibration_work(std::string_view message, const std::stop_token& stop,
                                        const WorkProgressSink& progress) {
  BOOST_OUTCOME_TRY(auto task, read_task(message));
  if (task.flights.empty() || task.n_answered > task.flights.size())
    return make_error(Errc::bad_frame, "the message has no flights");
  task.options.canceled = [&stop] { return stop.stop_requested(); };
  BOOST_OUTCOME_TRY(const auto answer,
                    solve_calibration(task, [&](double fraction, const std::string& detail) {
                      if (progress) progress({"solve", 2, 4, fraction, detail});
                    }));
  return answer_text(answer);
}

std::size_t answer_bytes(const CalibrationOrder& order) {
  std::size_t out = (order.kits.size() + 1) * k_answer_of_flight;
  for (std::size_t i = 0; i < order.n_answered; ++i)
    out += k_answer_of_flight + order.flights[i].anchors.size() * k_answer_of_anchor;
  return out;
}

std::string answer_text(const CalibrationAnswer& answer) { return packed(answer); }

Result<CalibrationAnswer> read_answer(const CalibrationOrder& order, std::string_view text) {
  BOOST_OUTCOME_TRY(auto answer, unpacked<CalibrationAnswer>(text, answer_bytes(order), true));
  for (std::size_t i = 0; i < std::min(answer.models.size(), order.reports.size()); ++i) {
    // What they did is what this server saw; what it is worth was asked.
    auto report = order.reports[i];
    report.worth = answer.models[i].worth;
    report.used = answer.models[i].used;
    answer.models[i] = std::move(report);
  }
  BOOST_OUTCOME_TRYV(check_answer(order, answer));
  return answer;
}

std::string order_text(const CalibrationOrder& order) { return packed(order); }

Result<CalibrationOrder> read_order(std::string_view text) {
  return unpacked<CalibrationOrder>(text, k_most_answer_bytes, false);
}

}  // namespace anchord::api
