// An answer from elsewhere against what was asked: nothing of it is believed because of who sent it.
#include <algorithm>
#include <set>

#include "api/calibration/calibration_record.hpp"

namespace anchord::api {
namespace {

/// Beyond it no conversion to the globe is meant to work.
constexpr double k_farthest_m = 1e9;

Error unfit(const std::string& what) { return make_error(Errc::bad_frame, what); }

bool is_covariance(const Eigen::Matrix3d& c) {
  return c.diagonal().minCoeff() >= 0 &&
         (c - c.transpose()).cwiseAbs().maxCoeff() <= 1e-6 * c.cwiseAbs().maxCoeff();
}

std::string fault_of(const Hypothesis& place) {
  if (place.position.m.cwiseAbs().maxCoeff() > k_farthest_m)
    return "a position is more than a million km away";
  if (!is_covariance(place.covariance_m2)) return "a covariance is none";
  if (place.probability < 0 || place.probability > 1) return "a probability is not within 0 and 1";
  return {};
}

std::string fault_of(const Estimate& estimate, const CalibrationOrder::Flight& flight) {
  if (!std::ranges::binary_search(flight.anchors, estimate.anchor)) return "no range of the flight names it";
  if (estimate.verdict == Verdict::ok && !estimate.best) return "it is ok without a position";
  if (estimate.n_used > flight.n_ranges) return "it used more ranges than the flight has";
  if (estimate.h95_m < 0 || estimate.v95_m < 0) return "an accuracy is negative";
  for (const auto* place : {&estimate.best, &estimate.mirror}) {
    if (!*place) continue;
    if (auto fault = fault_of(**place); !fault.empty()) return fault;
  }
  return {};
}

/// Estimates by ascending ids of the flight.
Result<void> check_estimates(const CalibrationOrder::Flight& flight,
                             const std::vector<const Estimate*>& estimates) {
  std::optional<NetworkId> before;
  for (const Estimate* estimate : estimates) {
    auto fault = fault_of(*estimate, flight);
    if (before && !(*before < estimate->anchor)) fault = "anchors are not in order of their ids";
    if (!fault.empty())
      return unfit("flight " + flight.name + ", anchor " + to_string(estimate->anchor) + ": " + fault);
    before = estimate->anchor;
  }
  return boost::outcome_v2::success();
}

Result<void> check_flight(const CalibrationOrder& order, const CalibrationOrder::Flight& flight,
                          const FlightAnswer& answer) {
  const auto& e = answer.evidence;
  if (e.n_fixes > flight.n_fixes || e.n_ranges > flight.n_ranges || e.n_used > e.n_ranges)
    return unfit("flight " + flight.name + ": it counts more rows than it has");
  for (const auto& [id, rows] : e.residuals)
    if (!std::ranges::binary_search(flight.anchors, id))
      return unfit("flight " + flight.name + ": residuals of " + to_string(id) + ", which no range names");
  if (!order.compare_uncorrected && !answer.uncorrected.empty())
    return unfit("flight " + flight.name + ": positions without models, which were not asked for");
  std::vector<const Estimate*> corrected, uncorrected;
  for (const auto& anchor : answer.anchors) corrected.push_back(&anchor.estimate);
  for (const auto& estimate : answer.uncorrected) uncorrected.push_back(&estimate);
  BOOST_OUTCOME_TRYV(check_estimates(flight, corrected));
  return check_estimates(flight, uncorrected);
}

/// Which flights a factor is of is KitProfiles::learn's to ask.
Result<void> check_learned(const CalibrationOrder& order, const std::vector<KitProfile>& learned) {
  if (!learned.empty() && (!order.use_profile || !order.teaches))
    return unfit("it teaches kits, which was not asked for");
  std::set<std::string> seen;
  for (const auto& profile : learned) {
    if (std::ranges::find(order.kits, profile.kit, &CalibrationOrder::Kit::name) == order.kits.end())
      return unfit("a profile of kit \"" + profile.kit + "\", which no flight names");
    if (!seen.insert(profile.kit).second) return unfit("two profiles of kit \"" + profile.kit + "\"");
    for (const auto& factor : profile.factors)
      if (!factor.information.isApprox(factor.information.transpose(), 1e-6))
        return unfit("kit \"" + profile.kit + "\": an information matrix is not symmetric");
  }
  return boost::outcome_v2::success();
}

Result<void> check_models(const CalibrationOrder& order, const std::vector<FlightModelsReport>& models) {
  if (models.size() != order.reports.size()) return unfit("models of other flights than were asked");
  for (const auto& report : models) {
    const bool may_be_left_out = order.ask_worth && report.spoke() && report.worth && !report.worth->shown;
    if (!report.used && !may_be_left_out) return unfit("models are left out that have shown their worth");
  }
  return boost::outcome_v2::success();
}

}  // namespace

Result<void> check_answer(const CalibrationOrder& order, const CalibrationAnswer& answer) {
  if (answer.flights.size() != order.n_answered)
    return unfit(std::to_string(answer.flights.size()) + " flights, and " + std::to_string(order.n_answered) +
                 " were asked");
  for (std::size_t i = 0; i < order.n_answered; ++i) {
    BOOST_OUTCOME_TRYV(check_flight(order, order.flights[i], answer.flights[i]));
    // Else every flight could be said to be another's copy, and none would count.
    const auto& original = answer.flights[i].copy_of;
    if (original && (*original >= order.n_answered || answer.flights[*original].copy_of))
      return unfit("flight \"" + order.flights[i].name + "\" is a copy of one that does not count");
  }
  for (const auto& [id, steps] : answer.course) {
    const bool heard = std::ranges::any_of(
        order.flights, [&](const auto& flight) { return std::ranges::binary_search(flight.anchors, id); });
    if (!heard || steps.size() > static_cast<std::size_t>(order.iterations))
      return unfit("the course of " + to_string(id) + " was not asked for");
  }
  BOOST_OUTCOME_TRYV(check_learned(order, answer.learned));
  return check_models(order, answer.models);
}

}  // namespace anchord::api
