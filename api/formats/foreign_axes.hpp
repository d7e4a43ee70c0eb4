#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "api/formats/foreign_columns.hpp"
#include "core/base/enum_table.hpp"

namespace anchord::api {

/// What x, y, z of a track count: east, north, up, or north, east, down, as autopilots write.
enum class TrackAxes : std::uint8_t { enu, ned };
inline constexpr auto k_track_axes_words =
    enum_table<TrackAxes>({{"enu", TrackAxes::enu}, {"ned", TrackAxes::ned}});

/// By the names of the columns and of those beside them that autopilots alone write; nothing where names say
/// nothing and the heights of an `own_frame` are what a z that counts downwards looks like.
std::optional<TrackAxes> track_axes(const ForeignTable& table, const ForeignColumns& columns, bool own_frame);
/// "east" or the like: which of x and y is which is said by their names, and z alone may count downwards.
bool is_east(std::string_view column);

/// East, north, up of x, y, z.
Eigen::Vector3d enu_of(const Eigen::Vector3d& xyz, TrackAxes axes, bool named_east);
/// The attitude of a body with axes forward, left, up; of NED that of one with forward, right, down is given.
Eigen::Quaterniond enu_attitude(const Eigen::Quaterniond& attitude, TrackAxes axes);

}  // namespace anchord::api
