#pragma once

#include <cstdint>
#include <optional>

#include "core/base/enum_table.hpp"

namespace anchord {

/// What a measurement must be like to be listed. A row that lacks a quantity passes no limit on it.
struct MeasurementLimits {
  enum class Label : std::uint8_t { los, nlos, none };  ///< none: nobody told what is true

  std::optional<double> min_distance_m, max_distance_m;  ///< as measured; both included
  std::optional<double> min_level_dbm, max_level_dbm;    ///< RX power, else the device's own RSS
  std::optional<Label> label;
};
inline constexpr auto k_label_words =
    enum_table<MeasurementLimits::Label>({{"los", MeasurementLimits::Label::los},
                                          {"nlos", MeasurementLimits::Label::nlos},
                                          {"none", MeasurementLimits::Label::none}});

}  // namespace anchord
