#include "api/formats/foreign_axes.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "api/formats/foreign_values.hpp"

namespace anchord::api {
namespace {

/// Heights nearer to zero are those of an aircraft that stands, whichever way z counts.
constexpr double k_standing_m = 0.3;
/// What a track that begins at its highest place has above that, by its noise, and what it falls at least.
constexpr double k_top_m = 0.5, k_fall_m = 1;

bool has_word(std::string_view column, std::string_view words) {
  const std::string name = plain_name(column);
  for (std::string_view rest = name; !rest.empty();) {
    const auto word = rest.substr(0, rest.find('_'));
    if (contains(words, ' ' + std::string(word) + ' ')) return true;
    rest.remove_prefix(std::min(rest.size(), word.size() + 1));
  }
  return false;
}

/// Columns that stand beside x, y, z in the local positions of PX4 (vehicle_local_position, ulog2csv) and of
/// MAVLink (LOCAL_POSITION_NED), both north, east, down.
bool beside_ned(const ForeignTable& table) {
  std::string names = " ";
  for (const auto& column : table.columns()) names += plain_name(column) + ' ';
  const auto all = [&](std::initializer_list<const char*> wanted) {
    return std::ranges::all_of(wanted,
                               [&](const char* w) { return contains(names, ' ' + std::string(w) + ' '); });
  };
  return all({"ref_timestamp"}) || all({"xy_valid", "z_valid"}) || all({"xy_global", "z_global"}) ||
         all({"vx", "vy", "vz", "ref_lat"}) || all({"vx", "vy", "vz", "time_boot_ms"});
}

/// Nearly all of it is below zero, or it begins at its top and falls below zero.
bool looks_downwards(const ForeignTable& table, std::string_view z) {
  const auto at = table.column(z);
  std::size_t n_below = 0, n_above = 0;
  double first = 0, least = 0, most = 0;
  bool any = false;
  for (std::size_t row = 0; at && row < table.n_rows(); ++row) {
    const double value = table.number(table.cell(row, *at));
    if (!std::isfinite(value)) continue;
    if (!any) first = least = most = value;
    any = true;
    least = std::min(least, value);
    most = std::max(most, value);
    n_below += value < -k_standing_m ? 1 : 0;
    n_above += value > k_standing_m ? 1 : 0;
  }
  return n_below > 0 &&
         (10 * n_below >= 9 * (n_below + n_above) || (most - first <= k_top_m && first - least >= k_fall_m));
}

}  // namespace

bool is_east(std::string_view column) { return has_word(column, " e east easting rechtswert ostwert pe "); }

std::optional<TrackAxes> track_axes(const ForeignTable& table, const ForeignColumns& columns,
                                    bool own_frame) {
  const auto name = [&](const char* field) {
    const auto at = columns.find(field);
    return at == columns.end() ? std::string_view() : std::string_view(at->second);
  };
  const auto z = name("z");
  if (has_word(z, " down d pd ned ") || has_word(name("x"), " ned ")) return TrackAxes::ned;
  if (has_word(z, " up u enu ecef alt altitude height h hoehe ell hae msl hmsl ")) return TrackAxes::enu;
  if (beside_ned(table)) return TrackAxes::ned;
  if (own_frame && looks_downwards(table, z)) return std::nullopt;
  return TrackAxes::enu;
}

Eigen::Vector3d enu_of(const Eigen::Vector3d& xyz, TrackAxes axes, bool named_east) {
  if (axes == TrackAxes::enu) return xyz;
  return named_east ? Eigen::Vector3d(xyz.x(), xyz.y(), -xyz.z())
                    : Eigen::Vector3d(xyz.y(), xyz.x(), -xyz.z());
}

Eigen::Quaterniond enu_attitude(const Eigen::Quaterniond& attitude, TrackAxes axes) {
  if (axes == TrackAxes::enu) return attitude;
  // Half a turn about north-east takes NED to ENU, and half a turn about forward left, up to right, down.
  const double half = std::sqrt(0.5);
  return Eigen::Quaterniond(0, half, half, 0) * attitude * Eigen::Quaterniond(0, 1, 0, 0);
}

}  // namespace anchord::api
