#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "api/formats/foreign_columns.hpp"
#include "api/formats/foreign_values.hpp"
#include "core/base/enum_table.hpp"

namespace anchord::api {

/// Unit and direction of a heading: clockwise from north, or counter-clockwise from east (ROS, ENU).
enum class HeadingKind : std::uint8_t { deg, rad, deg_from_east, rad_from_east };
inline constexpr auto k_heading_kind_words =
    enum_table<HeadingKind>({{"deg", HeadingKind::deg},
                             {"rad", HeadingKind::rad},
                             {"deg_ccw_from_east", HeadingKind::deg_from_east},
                             {"rad_ccw_from_east", HeadingKind::rad_from_east}});
/// Nothing where a person has to say it: a name without a unit, and no value beyond two pi.
std::optional<HeadingKind> heading_kind(const ForeignTable& table, std::string_view column);
/// Degrees clockwise from north, 0 to 360.
double north_deg(double value, HeadingKind kind);

/// How addresses without 0x are written.
enum class AddressKind : std::uint8_t { as_written, hex };
inline constexpr auto k_address_kind_words =
    enum_table<AddressKind>({{"names", AddressKind::as_written}, {"hex", AddressKind::hex}});
/// Four or more hexadecimal digits in each cell and a letter in one, or in the text given: 1021 beside 9E04.
bool may_be_hexadecimal(const ForeignTable& table, std::string_view column, std::string_view given = {});
ForeignId foreign_id(std::string_view text, AddressKind kind);

/// Whether each number of a column is written as thousands are, "12.345" or "985", and one has more than
/// three digits.
bool has_thousands(const ForeignTable& table, std::string_view column);

/// The column of N and S, or E and W, that a latitude or a longitude needs: by its name, or right beside it.
std::optional<std::string> hemisphere_column(const ForeignTable& table, const ForeignColumns& columns,
                                             std::string_view field);
/// +1 or -1; nothing where the cell has no letter of that axis.
std::optional<int> hemisphere_sign(std::string_view cell);

/// A column that says in which unit another one is.
struct UnitColumn {
  std::string name, word;
  std::optional<LengthUnit> unit;  ///< nothing: feet, several, or another that is not read
};
std::optional<UnitColumn> unit_column(const ForeignTable& table, const ForeignColumns& columns,
                                      std::string_view field);

/// A date with the zone that stands in a column of its own; one that has a zone keeps it.
std::string with_zone(std::string_view date, std::string_view zone);

}  // namespace anchord::api
