#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "core/ports/revision_store.hpp"
#include "core/types/anchor.hpp"
#include "core/types/estimate.hpp"

namespace anchord::api {

/// An estimate with what its numbers are numbers of.
struct PlacedEstimate {
  Estimate estimate;
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Wgs84> origin{};
};
using PlacedEstimates = std::map<NetworkId, PlacedEstimate>;
PlacedEstimates placed(const Calibration& calibration);
PlacedEstimates placed(const std::vector<PublishedPosition>& positions);

/// How one anchor differs between two answers.
struct PositionChange {
  NetworkId anchor{};
  const PlacedEstimate* now{nullptr};     ///< null: only before
  const PlacedEstimate* before{nullptr};  ///< null: only now
  /// Now minus before in the axes of `now`; absent unless both have a position on the globe, or both in a
  /// local frame (taken to be the same one).
  std::optional<Eigen::Vector3d> delta_m{};
  /// Gate "moved": is the difference within what both covariances allow? Absent where delta_m is.
  std::optional<Gate> gate{};
  bool moved() const;
};
std::vector<PositionChange> changes(const PlacedEstimates& now, const PlacedEstimates& before);

}  // namespace anchord::api
