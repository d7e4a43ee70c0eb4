#pragma once

#include <cstdint>
#include <optional>

#include "core/base/enum_table.hpp"
#include "core/planning/local_plan.hpp"

namespace anchord::flight {

/// Where the flown time lies in the spread of the forecast.
enum class AgainstForecast : std::uint8_t { within, shorter, longer };
inline constexpr auto k_against_forecast_words =
    enum_table<AgainstForecast>({{"within", AgainstForecast::within},
                                 {"shorter", AgainstForecast::shorter},
                                 {"longer", AgainstForecast::longer}});

/// How long a flight took, beside what was forecast when it was started.
struct FlownTime {
  std::optional<planning::FlightTime> forecast{};  ///< of the plan at Start; none: it could not be checked
  double flown_s{};                                ///< from the start to the landing, restarts included
  bool completed{false};                           ///< all that was planned was flown
  bool plan_changed{false};                        ///< in flight: the forecast is of another plan

  /// Nothing where the two are not of the same flight: none forecast, ended early, or another plan flown.
  std::optional<AgainstForecast> against() const {
    if (!forecast || !completed || plan_changed) return std::nullopt;
    if (flown_s < forecast->low_s) return AgainstForecast::shorter;
    return flown_s > forecast->high_s ? AgainstForecast::longer : AgainstForecast::within;
  }
};

}  // namespace anchord::flight
