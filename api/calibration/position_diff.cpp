#include "api/calibration/position_diff.hpp"

#include "core/geo/enu.hpp"
#include "core/localize/gates.hpp"

namespace anchord::api {
namespace {

void compare(PositionChange& change) {
  const PlacedEstimate &now = *change.now, &before = *change.before;
  if (!now.estimate.best || !before.estimate.best || now.frame != before.frame) return;
  Eigen::Matrix3d covariance = before.estimate.best->covariance_m2;
  Eigen::Vector3d there = before.estimate.best->position.m;
  if (now.frame == TrackFrame::wgs84) {
    if (!now.origin || !before.origin) return;
    const EnuFrame here(*now.origin), old(*before.origin);
    there = here.enu_from_wgs84(old.wgs84_from_enu(before.estimate.best->position)).m;
    covariance = old.covariance_in(here, covariance);
  }
  change.delta_m = now.estimate.best->position.m - there;
  Estimate old = before.estimate;
  old.best->position.m = there;
  old.best->covariance_m2 = covariance;
  change.gate = moved_gate(now.estimate, old);
  change.gate->name = "moved";
}

}  // namespace

bool PositionChange::moved() const { return gate && !gate->passed; }

PlacedEstimates placed(const Calibration& calibration) {
  PlacedEstimates out;
  for (const auto& estimate : calibration.anchors)
    out[estimate.anchor] = {estimate, calibration.frame, calibration.origin};
  return out;
}

PlacedEstimates placed(const std::vector<PublishedPosition>& positions) {
  PlacedEstimates out;
  for (const auto& position : positions)
    out[position.estimate.anchor] = {position.estimate, position.frame, position.origin};
  return out;
}

std::vector<PositionChange> changes(const PlacedEstimates& now, const PlacedEstimates& before) {
  std::vector<PositionChange> out;
  for (const auto& [id, estimate] : now) {
    PositionChange change;
    change.anchor = id;
    change.now = &estimate;
    const auto old = before.find(id);
    if (old != before.end()) {
      change.before = &old->second;
      compare(change);
    }
    out.push_back(change);
  }
  for (const auto& [id, estimate] : before) {
    if (now.count(id) == 0) out.push_back({id, nullptr, &estimate, std::nullopt, std::nullopt});
  }
  return out;
}

}  // namespace anchord::api
