#include "api/formats/foreign_reading.hpp"

#include <algorithm>
#include <cmath>

#include "api/formats/foreign_values.hpp"
#include "api/formats/globe_track.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::string_view k_needs_time_of_ranges = "time of the ranges", k_needs_tag = "tag address",
                           k_needs_fix = "fix numbers", k_needs_degrees = "degrees", k_needs_crs = "crs",
                           k_needs_heights = "heights", k_needs_heading = "heading",
                           k_needs_addresses = "addresses", k_needs_axes = "axes",
                           k_needs_track_unit = "unit of the track times",
                           k_needs_range_unit = "unit of the range times";

/// Lengths whose unit stands in a column of its own; those that an option gives are not looked at.
void read_units(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& o, Reading& r) {
  const auto look = [&](const ForeignTable& table, const ForeignColumns& columns, const char* field,
                        double* per_metre_out) {
    const auto beside = unit_column(table, columns, field);
    if (!beside) return;
    if (per_metre_out != nullptr && beside->unit) {
      *per_metre_out = per_metre(*beside->unit);
    } else if (beside->unit != LengthUnit::m && r.contradiction.empty()) {
      r.contradiction = table.name() + ": the column '" + beside->name + "' says that '" +
                        std::string(column_of(columns, field)) + "' is in " + beside->word +
                        ": write it in metres" +
                        (per_metre_out != nullptr ? ", centimetres or millimetres" : "");
    }
  };
  if (!o.range_unit) look(ranges, r.rc, "range", &r.range_per_metre);
  const auto range = column_of(r.rc, "range");
  if (r.range_per_metre != 1 && has_thousands(ranges, range) && r.contradiction.empty())
    r.contradiction = ranges.name() + ": the column '" + std::string(range) + "' is in " +
                      (r.range_per_metre == 1000 ? "mm" : "cm") +
                      " and all of it is written as thousands are, with a point or comma before three "
                      "digits: write it without";
  if (!o.height_unit) look(track, r.tc, r.local ? "z" : "height", &r.height_per_metre);
  for (const char* field : {"separation", "x", "y"}) look(track, r.tc, field, nullptr);
}

/// The unit of one column of one file is the same for its track and its ranges, whoever says it.
void read_times(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& o, Reading& r) {
  const auto of_track = column_of(r.tc, "time"), of_ranges = column_of(r.rc, "time");
  const bool same = !of_track.empty() && of_track == of_ranges && track.name() == ranges.name();
  auto track_unit = o.track_time_unit, range_unit = o.range_time_unit;
  auto track_scale = o.track_time_scale, range_scale = o.range_time_scale;
  if (same) {
    if ((track_unit && range_unit && track_unit != range_unit) ||
        (track_scale && range_scale && track_scale != range_scale))
      r.contradiction =
          track.name() + ": '" + std::string(of_track) +
          "' is the time of the track and of the ranges: give --track-time and --range-time the "
          "same unit and clock";
    track_unit = range_unit = track_unit ? track_unit : range_unit;
    track_scale = range_scale = track_scale ? track_scale : range_scale;
  }
  const auto read = [](const TimeGuess& guess, std::optional<TimeUnit> unit, std::optional<TimeScale> scale,
                       TimeReading& time_out, std::vector<TimeUnit>& units_out) {
    time_out = {unit.value_or(guess.reading.unit), scale.value_or(guess.reading.scale)};
    if (!unit) units_out = guess.fits;
  };
  const TimeGuess guess = time_guess(track, of_track);
  read(guess, track_unit, track_scale, r.track_time, r.track_units);
  read(same ? guess : time_guess(ranges, of_ranges), range_unit, range_scale, r.range_time, r.range_units);
}

std::optional<HeadingKind> heading_of(const ForeignTable& track, const ForeignColumns& tc) {
  if (!tc.contains("heading")) return HeadingKind::deg;
  for (const char* part : {"qx", "qy", "qz", "qw"})
    if (!tc.contains(part)) return heading_kind(track, column_of(tc, "heading"));
  return HeadingKind::deg;  // attitudes come before a heading
}

/// Nothing where nothing says it, and where it is sea level by a geoid that nothing names.
std::optional<std::string> heights_by_name(const ForeignTable& track, const Reading& reading) {
  const std::string name = plain_name(column_of(reading.tc, reading.local ? "z" : "height"));
  if (contains(name, "msl") || contains(name, "orthometric") || contains(name, "sea_level") ||
      contains(name, "nhn"))
    return reading.tc.contains("separation") ? std::optional<std::string>("column") : std::nullopt;
  for (std::string_view rest = name; !rest.empty();) {
    const auto word = rest.substr(0, rest.find('_'));
    if (word == "ell" || word == "hae" || word.starts_with("ellips")) return "ellipsoidal";
    rest.remove_prefix(std::min(rest.size(), word.size() + 1));
  }
  return name == "h_m" || track.ellipsoidal() ? std::optional<std::string>("ellipsoidal") : std::nullopt;
}

std::string units_words(const ForeignTable& table, std::string_view column,
                        const std::vector<TimeUnit>& units, const char* option) {
  std::string words;
  for (const auto unit : units)
    words += (words.empty() ? "" : " or ") + std::string(k_time_unit_words.word(unit));
  return table.name() + ": the times in '" + std::string(column) +
         "' have no unit, and their spacing allows several: give " + option + ' ' + words;
}

}  // namespace

std::string_view column_of(const ForeignColumns& columns, std::string_view field) {
  const auto at = columns.find(field);
  return at == columns.end() ? std::string_view() : std::string_view(at->second);
}

ForeignColumns merged(ForeignColumns guessed, const ForeignColumns& said) {
  // Whoever names a column of one kind of place means no other.
  const auto says = [&](std::initializer_list<const char*> fields) {
    return std::ranges::any_of(fields, [&](const char* f) { return said.contains(f); });
  };
  if (says({"lat", "lon", "height"}) && !says({"x", "y", "z"}))
    for (const char* f : {"x", "y", "z"}) guessed.erase(f);
  if (says({"x", "y", "z"}) && !says({"lat", "lon", "height"}))
    for (const char* f : {"lat", "lon", "height"}) guessed.erase(f);
  for (const auto& [field, column] : said) {
    if (column.empty())
      guessed.erase(field);
    else
      guessed[field] = column;
  }
  return guessed;
}

Reading reading_of(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& o) {
  Reading r;
  r.tc = merged(guessed_track_columns(track), o.track_columns);
  r.rc = merged(guessed_range_columns(ranges), o.range_columns);
  r.local = is_local(r.tc);
  r.kind = place_kind(track, r.tc);
  read_times(track, ranges, o, r);
  r.range_per_metre = per_metre(o.range_unit.value_or(range_unit(ranges, column_of(r.rc, "range"))));
  r.fix = o.fix_numbers;
  if (!r.tc.contains("fix"))
    r.fix = FixNumbers::words;
  else if (!r.fix)
    r.fix = fix_numbers(track, column_of(r.tc, "fix"));
  r.heading = o.heading ? o.heading : heading_of(track, r.tc);
  r.addresses = o.addresses;
  if (!r.addresses && !may_be_hexadecimal(ranges, column_of(r.rc, "anchor")) &&
      !may_be_hexadecimal(ranges, column_of(r.rc, "tag"), o.tag))
    r.addresses = AddressKind::as_written;
  r.crs = o.crs;
  if (!r.crs && r.kind != PlaceKind::map) r.crs = r.kind == PlaceKind::ecef ? "ECEF" : "";
  r.heights = o.heights ? o.heights : heights_by_name(track, r);
  const auto height = column_of(r.tc, r.local ? "z" : "height");
  const auto values = track.sample_numbers(height);
  // Who writes whole numbers of 1e-7 degrees writes whole millimetres.
  const bool whole_mm = r.kind == PlaceKind::degrees_1e7 &&
                        std::ranges::all_of(values, [](double v) { return v == std::trunc(v); });
  const auto by_name = unit_of_name(height);
  r.height_per_metre =
      per_metre(o.height_unit.value_or(by_name.value_or(whole_mm ? LengthUnit::mm : LengthUnit::m)));
  read_units(track, ranges, o, r);
  const bool ecef = r.crs && plain_name(*r.crs) == "ecef";
  r.axes = TrackAxes::enu;
  if (r.local && !ecef) r.axes = o.axes ? o.axes : track_axes(track, r.tc, r.crs && r.crs->empty());
  r.heights_matter = !r.local || (!(r.crs && r.crs->empty()) && !ecef);
  return r;
}

Needs needs_of(const Reading& r, const std::string& tag) {
  Needs out = missing_track_fields(r.tc);
  for (const auto& field : missing_range_fields(r.rc))
    out.push_back(field == "time" ? std::string(k_needs_time_of_ranges) : field);
  if (!r.rc.contains("tag") && tag.empty()) out.emplace_back(k_needs_tag);
  if (!r.fix) out.emplace_back(k_needs_fix);
  if (!r.heading) out.emplace_back(k_needs_heading);
  if (!r.addresses) out.emplace_back(k_needs_addresses);
  if (!r.axes) out.emplace_back(k_needs_axes);
  if (r.track_units.size() > 1) out.emplace_back(k_needs_track_unit);
  if (r.range_units.size() > 1) out.emplace_back(k_needs_range_unit);
  if (r.kind == PlaceKind::no_degrees) out.emplace_back(k_needs_degrees);
  if (!r.crs) out.emplace_back(k_needs_crs);
  if (r.heights_matter && !r.heights) out.emplace_back(k_needs_heights);
  return out;
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const auto& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

std::string words_of(const std::string& need, const ForeignTable& track, const ForeignTable& ranges,
                     const Reading& r) {
  const std::string column_option = " (have: " + listed(track.columns()) + "): --column track.";
  if (need == k_needs_tag) return "no column has the tag: give --tag 0x6e01, or --column ranges.tag=NAME";
  if (need == k_needs_fix)
    return track.name() + ": 1 and 2 in '" + std::string(column_of(r.tc, "fix")) +
           "' have different meanings in different programs: give --fix-numbers solution, nmea, rtklib or "
           "mavlink";
  if (need == k_needs_heading)
    return track.name() + ": '" + std::string(column_of(r.tc, "heading")) +
           "' has no unit, and no value beyond two pi: give --heading deg or rad (clockwise from true "
           "north), deg_ccw_from_east or rad_ccw_from_east (ROS)";
  if (need == k_needs_addresses)
    return ranges.name() +
           ": addresses look like hexadecimal numbers without 0x, 1021 beside 9E04: give --addresses hex, or "
           "names where they are names and decimal numbers";
  if (need == k_needs_axes)
    return track.name() + ": nearly all of '" + std::string(column_of(r.tc, "z")) +
           "' is below zero, or it falls at take-off: give --track-axes ned where x, y, z are north, east, "
           "down (PX4, ArduPilot), or enu where z counts upwards";
  if (need == k_needs_track_unit)
    return units_words(track, column_of(r.tc, "time"), r.track_units, "--track-time");
  if (need == k_needs_range_unit)
    return units_words(ranges, column_of(r.rc, "time"), r.range_units, "--range-time");
  if (need == k_needs_degrees)
    return track.name() +
           ": the columns of latitude and longitude are not in decimal degrees (degrees and minutes, or one "
           "for the other?): write decimal degrees, exchange them with --column track.lat=NAME and "
           "track.lon, or give --column track.x=NAME, track.y, track.z and --crs EPSG:CODE of a map";
  if (need == k_needs_crs)
    return track.name() + ": x, y, z are " + k_of_a_map + ": --crs EPSG:25832, UTM 32N or ECEF";
  if (need == k_needs_heights)
    return track.name() + ": it is not stated what the heights in '" +
           std::string(column_of(r.tc, r.local ? "z" : "height")) +
           "' are above: --heights ellipsoidal, EPSG:5773 (mean sea level, EGM96), metres of the geoid "
           "there, or column with --column track.separation=NAME";
  if (need == k_needs_time_of_ranges || need == "anchor" || need == "range") {
    const std::string field = need == k_needs_time_of_ranges ? "time" : need;
    return ranges.name() + ": no column was found for the " + field + " (have: " + listed(ranges.columns()) +
           "): --column ranges." + field + "=NAME" + (need == "range" ? ", or --column-for-each-anchor" : "");
  }
  const bool of_globe = need == "lat" || need == "lon" || need == "height";
  return track.name() + ": no column was found for " + need + column_option + need + "=NAME" +
         (of_globe ? ", or track.x=NAME, track.y, track.z of a local frame or a map" : "");
}

Result<void> check_columns(const ForeignTable& table, const ForeignColumns& columns, const char* of) {
  for (const auto& [field, column] : columns) {
    if (std::ranges::find(k_foreign_fields, field, &FieldNames::field) == k_foreign_fields.end())
      return make_error(Errc::invalid_argument, std::string(of) + '.' + field + ": there is no such field");
    if (!column.empty() && !table.column(column))
      return make_error(Errc::invalid_argument, table.name() + ": there is no column '" + column +
                                                    "' (have: " + listed(table.columns()) + ')');
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::api
