#pragma once

#include <optional>

#include "core/types/range_belief.hpp"

namespace anchord {

/// What the promoted models say of a range: made from the measurement when it is used, never stored with it.
struct RangeModel {
  std::optional<bool> los{};
  std::optional<double> p_los{};
  std::optional<double> bias_m{};   ///< subtract it from the distance
  std::optional<double> sigma_m{};  ///< of what is left
  bool outside_training{false};
  std::optional<RangeBelief> belief{};  ///< of the error that is left once bias_m is off
};

}  // namespace anchord
