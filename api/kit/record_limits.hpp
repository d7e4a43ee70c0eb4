#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "api/kit/value_bounds.hpp"

namespace anchord::api {

/// What a field of a record (site, mission, anchor, floor) may be: the same for every reader of records.
/// Texts in characters.
namespace record_limits {

/// Longest names and texts of facility data; beyond it somebody pastes a document into a field.
inline constexpr std::size_t k_name = 200;
inline constexpr std::size_t k_frame_name = 80, k_token_name = 100, k_external_system = 60, k_reason = 500,
                             k_note = 500;
inline constexpr std::size_t k_words = 10'000;  ///< what the server says of a row or an event

inline constexpr std::int64_t k_latest_us = 9'000'000'000'000'000;  ///< in the year 2255, still 64 bits of ns

inline constexpr Bounds k_crs_epoch_year{1900, 2200}, k_base_sigma_m{0, 100};
inline constexpr std::array<std::string_view, 3> k_base_sources{"known_point", "survey_in", "network"};
inline constexpr WholeBounds k_epsg{1024, 999'999};
inline constexpr std::size_t k_outline_bytes = 100'000;

inline constexpr Bounds k_lever_arm_m{-100, 100};
inline constexpr std::size_t k_most_tags = 64;

inline constexpr Bounds k_building_height_m{1, 1000}, k_floor_level{-50, 300}, k_floor_base_m{-300, 1000};

}  // namespace record_limits
}  // namespace anchord::api
