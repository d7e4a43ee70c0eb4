#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/base/ids.hpp"
#include "core/localize/gates.hpp"

namespace anchord {

/// A position with how well it is known, metres in one frame for all that is compared.
struct KnownPlace {
  Eigen::Vector3d at_m{0, 0, 0};
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};
};

/// An anchor as readers have it and as a later flight found it.
struct PlaceTwice {
  NetworkId anchor{};
  KnownPlace published, later;
  bool acceptable{true};  ///< the later answer passed every gate
  bool plane{false};      ///< one of them held its height: compared horizontally
};

/// A later flight found the anchor outside of what both regions allow.
struct Contradiction {
  NetworkId anchor{};
  Eigen::Vector3d delta_m{0, 0, 0};  ///< later minus published
  bool plane{false};
  double chi2{}, limit{};
  double p_value{};  ///< chance of so large a difference had nothing changed
  /// The anchor whose published place it has, and which has its own: the two were exchanged. Sums of both
  /// anchors' chi2 as they are named and with names exchanged.
  struct Exchange {
    NetworkId with{};
    double chi2{}, chi2_exchanged{};
  };
  std::optional<Exchange> exchange{};
};

/// Which anchors were moved or exchanged, in the order given.
///
/// The difference is held against the sum of both covariances, chi-square with three degrees of freedom (two
/// where a height was held), at GateLimits::probability: two independent regions of 95 % do not overlap then.
/// An answer that failed a gate may be off by more than its region, so it contradicts only at five times that
/// distance. Two contradicted anchors are exchanged where swapping their names brings both within the limit,
/// or makes the misfit 25 times smaller (hung up again nearby, not on the spot); each is in one pair at most.
///
/// pairs    finite positions, positive definite covariances; others are passed over
/// threads  pure; safe to call from any thread
std::vector<Contradiction> contradictions(std::span<const PlaceTwice> pairs, const GateLimits& limits = {});

}  // namespace anchord
