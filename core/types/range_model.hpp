#pragma once

#include <optional>
#include <string_view>

#include "core/base/ids.hpp"
#include "core/types/range_error_model.hpp"

namespace anchord {

/// The models that gave a range its class or its bias, by their task.
struct RangeModels {
  std::optional<ModelId> nlos_id{}, los_bias{}, nlos_bias{}, bias{};
};

/// What the promoted models say of a range: made from the measurement when it is used, never stored with it.
struct RangeModel {
  std::optional<bool> los{};
  std::optional<double> p_los{};
  std::optional<double> bias_m{};   ///< subtract it from the distance
  std::optional<double> sigma_m{};  ///< of what is left
  bool outside_training{false};
  std::string_view withheld{};  ///< why a correction that was computed is not given (ml::why_withheld)
  std::optional<RangeErrorModel> error_model{};  ///< of the error that is left once bias_m is off
  RangeModels models{};
};

}  // namespace anchord
