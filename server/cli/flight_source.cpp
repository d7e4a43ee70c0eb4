#include "server/cli/flight_source.hpp"

#include <CLI/CLI.hpp>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "api/formats/foreign_flight.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "drivers/gnss/decoder.hpp"

namespace anchord::cli {
namespace {

using api::ForeignOptions;
using api::ForeignTable;

constexpr std::uintmax_t k_most_mapping_bytes = 1 << 20;

Error wrong(const std::string& expected) { return make_error(Errc::invalid_argument, expected); }

Result<double> number(std::string_view text) {
  double value{};
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    return wrong("expected a number");
  return value;
}

template <class T, std::size_t N>
Result<void> word(std::string_view text, const EnumTable<T, N>& table, std::optional<T>& out) {
  out = table.find(text);
  if (out) return boost::outcome_v2::success();
  return wrong("expected one of " + list_of(table.words()));
}

/// "gps", "ms" or "ms,gps".
Result<void> read_time(std::string_view text, std::optional<api::TimeUnit>& unit,
                       std::optional<api::TimeScale>& scale) {
  while (!text.empty()) {
    const auto end = text.find(',');
    const auto part = text.substr(0, end);
    if (const auto known = api::k_time_unit_words.find(part))
      unit = known;
    else if (const auto clock = api::k_time_scale_words.find(part))
      scale = clock;
    else
      return wrong("expected a unit (date, s, ms, us, ns), a clock (utc, gps) or both, such as ms,gps");
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return boost::outcome_v2::success();
}

Result<void> read_one_arm(std::string_view text, Eigen::Vector3d& arm_m) {
  for (int axis = 0; axis < 3; ++axis) {
    const auto end = text.find(',');
    const auto value = number(text.substr(0, end));
    if (!value || std::abs(value.value()) > 100 || (axis < 2) != (end != std::string_view::npos))
      return wrong("expected three numbers of metres: forward,left,up");
    arm_m[axis] = value.value();
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return boost::outcome_v2::success();
}

/// "0.1,0,-0.2", "0x6e01=0.1,0,-0.2", or several with ";" between them.
Result<void> read_arms(std::string_view text, ForeignOptions& out) {
  while (!text.empty()) {
    const auto end = text.find(';');
    const auto one = text.substr(0, end);
    const auto equals = one.find('=');
    if (equals == 0) return wrong("expected TAG=forward,left,up");
    BOOST_OUTCOME_TRYV(equals == std::string_view::npos
                           ? read_one_arm(one, out.lever_arm_body_m)
                           : read_one_arm(one.substr(equals + 1),
                                          out.lever_arms_body_m[std::string(one.substr(0, equals))]));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return boost::outcome_v2::success();
}

struct Setting {
  const char* name;
  const char* help;
  Result<void> (*read)(const std::string& text, ForeignOptions& out);
};
constexpr const char* k_lever_arm = "lever-arm";
constexpr std::array k_settings{
    Setting{"tag", "Radio address of the tag, if no column has it",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              out.tag = text;
              return boost::outcome_v2::success();
            }},
    Setting{"kit", "Name of the kit: its flights share one calibration of the range bias",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              out.kit = text;
              return boost::outcome_v2::success();
            }},
    Setting{"point", "Point that the track gives: gnss_antenna (default), body, tag_antenna",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              std::optional<TrackPoint> point;
              BOOST_OUTCOME_TRYV(word(text, k_point_words, point));
              out.point = *point;
              return boost::outcome_v2::success();
            }},
    Setting{
        k_lever_arm,
        "From that point to the tag in metres: forward,left,up; of several tags TAG=forward,left,up for each",
        [](const std::string& text, ForeignOptions& out) { return read_arms(text, out); }},
    Setting{"lever-arm-sigma", "One sigma of that measurement in metres",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              BOOST_OUTCOME_TRY(out.lever_arm_sigma_m, number(text));
              if (is_lever_arm_sigma(*out.lever_arm_sigma_m)) return boost::outcome_v2::success();
              return wrong(k_lever_arm_sigma_rule);
            }},
    Setting{"epoch", "RFC 3339: t = 0 of times that count from the beginning of the flight",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              BOOST_OUTCOME_TRY(const UtcTime epoch, parse_rfc3339(text));
              out.epoch_us = epoch.us();
              return boost::outcome_v2::success();
            }},
    Setting{"track-time", "Times of the track: date, s, ms, us or ns, and utc or gps, such as ms,gps",
            [](const std::string& text, ForeignOptions& out) {
              return read_time(text, out.track_time_unit, out.track_time_scale);
            }},
    Setting{"range-time", "Times of the ranges, as --track-time",
            [](const std::string& text, ForeignOptions& out) {
              return read_time(text, out.range_time_unit, out.range_time_scale);
            }},
    Setting{"range-unit", "m, cm or mm",
            [](const std::string& text, ForeignOptions& out) {
              return word(text, api::k_length_unit_words, out.range_unit);
            }},
    Setting{"height-unit", "m, cm or mm",
            [](const std::string& text, ForeignOptions& out) {
              return word(text, api::k_length_unit_words, out.height_unit);
            }},
    Setting{"heading",
            "Unit and direction of the heading: deg or rad (clockwise from true north), deg_ccw_from_east, "
            "rad_ccw_from_east",
            [](const std::string& text, ForeignOptions& out) {
              return word(text, api::k_heading_kind_words, out.heading);
            }},
    Setting{"addresses", "Addresses without 0x: hex, or names (names and decimal numbers)",
            [](const std::string& text, ForeignOptions& out) {
              return word(text, api::k_address_kind_words, out.addresses);
            }},
    Setting{
        "fix-numbers",
        "Meaning of the fix class: solution, nmea, rtklib, mavlink; of words: words, or gnss (FIX is no RTK)",
        [](const std::string& text, ForeignOptions& out) {
          return word(text, api::k_fix_numbers_words, out.fix_numbers);
        }},
    Setting{"track-axes",
            "x, y, z of the track: enu (east, north, up) or ned (north, east, down: PX4, ArduPilot)",
            [](const std::string& text, ForeignOptions& out) {
              return word(text, api::k_track_axes_words, out.axes);
            }},
    Setting{"crs", "Coordinate system of x, y, z: EPSG:25832, UTM 32N, ECEF",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              out.crs = text;
              return boost::outcome_v2::success();
            }},
    Setting{"heights",
            "Reference of the heights: ellipsoidal, EPSG:5773 (mean sea level, EGM96) or another vertical "
            "system, metres of the geoid there, or column",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              out.heights = text;
              SourceCrsSpec checked;
              if (text == "column") return boost::outcome_v2::success();
              return read_heights(text, checked);
            }},
    Setting{"max-datum-error", "Largest accepted error of a datum transformation, in metres; default 0.5",
            [](const std::string& text, ForeignOptions& out) -> Result<void> {
              BOOST_OUTCOME_TRY(out.max_datum_error_m, number(text));
              return boost::outcome_v2::success();
            }}};

/// "track.lat=Breite"
Result<void> read_column(const std::string& text, ForeignOptions& out) {
  const auto equals = text.find('=');
  const auto field = text.substr(0, equals);
  for (auto [prefix, columns] :
       {std::pair{"track.", &out.track_columns}, std::pair{"ranges.", &out.range_columns}}) {
    if (equals == std::string::npos || !field.starts_with(prefix)) continue;
    (*columns)[field.substr(std::string_view(prefix).size())] = text.substr(equals + 1);
    return boost::outcome_v2::success();
  }
  return wrong("--column " + text + ": expected track.FIELD=NAME or ranges.FIELD=NAME");
}

Result<void> read_setting(const std::string& key, const std::string& text, ForeignOptions& out) {
  const auto* const known =
      std::ranges::find(k_settings, key, [](const Setting& s) { return std::string(s.name); });
  if (known == k_settings.end()) return wrong(key + ": there is no such setting");
  const auto read = known->read(text, out);
  if (!read) return wrong(key + " '" + text + "': " + read.error().message);
  return boost::outcome_v2::success();
}

/// {"track": {field: column}, "ranges": {...}, "column_for_each_anchor": true, and settings by the names of
/// their options}
Result<void> read_mapping(const std::string& file, ForeignOptions& out) {
  std::error_code ignored;
  const auto size = std::filesystem::file_size(file, ignored);
  if (ignored || size > k_most_mapping_bytes)
    return make_error(Errc::not_found, file + ": cannot be opened, or larger than 1 MiB");
  std::ifstream in(file, std::ios::binary);
  const auto json = nlohmann::json::parse(std::istreambuf_iterator<char>(in), {}, nullptr, false);
  if (!json.is_object()) return wrong(file + ": is not a JSON object");
  for (const auto& [key, value] : json.items()) {
    const bool columns = key == "track" || key == "ranges";
    if (columns && value.is_object()) {
      for (const auto& [field, column] : value.items()) {
        if (!column.is_string())
          return wrong(file + ": " + key + '.' + field + " is not the name of a column");
        (key == "track" ? out.track_columns : out.range_columns)[field] = column.get<std::string>();
      }
    } else if (key == k_lever_arm && value.is_object()) {
      for (const auto& [tag, arm] : value.items()) {
        const auto read = read_setting(key, tag + '=' + (arm.is_string() ? arm.get<std::string>() : ""), out);
        if (!read) return wrong(file + ": " + read.error().message);
      }
    } else if (key == "column_for_each_anchor" && value.is_boolean()) {
      out.column_for_each_anchor = value.get<bool>();
    } else if (value.is_string() || value.is_number()) {
      const auto read = read_setting(key, value.is_string() ? value.get<std::string>() : to_wire(value), out);
      if (!read) return wrong(file + ": " + read.error().message);
    } else {
      return wrong(file + ": " + key + ": expected a text or a number" + (columns ? " of each field" : ""));
    }
  }
  return boost::outcome_v2::success();
}

bool is_gnss_log(const std::string& file) {
  const auto ending = std::filesystem::path(file).extension();
  if (ending == ".nmea" || ending == ".ubx") return true;
  std::ifstream in(file, std::ios::binary);
  std::array<char, 2> first{};
  in.read(first.data(), first.size());
  return first[0] == '$' || (first[0] == '\xB5' && first[1] == 'b');
}

/// One row an epoch, under the names that tables have.
Result<ForeignTable> table_of_log(const std::string& file, std::int64_t epoch_us) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return make_error(Errc::not_found, file + ": cannot be opened");
  gnss::DecoderOptions options;
  if (epoch_us != 0) options.reference = UtcTime::from_us(epoch_us);
  gnss::Decoder decoder(options);
  gnss::Epochs epochs;
  std::array<char, 65536> buffer{};
  while (in.read(buffer.data(), buffer.size()), in.gcount() > 0)
    decoder.feed({buffer.data(), static_cast<std::size_t>(in.gcount())}, epochs);
  decoder.finish(epochs);
  const bool ellipsoidal =
      std::ranges::any_of(epochs, [](const auto& e) { return e.height_ellipsoid_m.has_value(); });
  std::string text = std::string("time_utc,lat_deg,lon_deg,") +
                     (ellipsoidal ? "height_ellipsoid_m" : "alt_msl_m") +
                     ",fix,sigma_e_m,sigma_n_m,sigma_u_m,correction_age_s,satellites\n";
  std::size_t n_dateless = 0, n = 0;
  const auto put = [&](const std::optional<double>& value) {
    std::array<char, 32> digits{};
    const auto end =
        value ? std::to_chars(digits.data(), digits.data() + digits.size(), *value).ptr : digits.data();
    text += ',';
    text.append(digits.data(), end);
  };
  for (const auto& epoch : epochs) {
    if (!epoch.lat_deg || !epoch.lon_deg) continue;
    if (!epoch.time) {
      ++n_dateless;
      continue;
    }
    ++n;
    text += to_rfc3339(*epoch.time);
    put(epoch.lat_deg);
    put(epoch.lon_deg);
    put(ellipsoidal ? epoch.height_ellipsoid_m : epoch.height_msl_m);
    text += ',' + std::string(k_fix_words.word(epoch.fix));
    put(epoch.sigma_e_m);
    put(epoch.sigma_n_m);
    put(epoch.sigma_u_m);
    put(epoch.age_s);
    text += ',' + (epoch.satellites ? std::to_string(*epoch.satellites) : std::string()) + '\n';
  }
  if (n == 0)
    return wrong(file + ": no position with a time in it" +
                 (n_dateless > 0 ? "; no sentence has the date (RMC, ZDA): --epoch DATE of the flight" : ""));
  return ForeignTable::parse(file, text);
}

}  // namespace

std::string ForeignSource::name() const {
  return std::filesystem::path(ranges.empty() ? track : ranges).stem().string();
}

void add_foreign_source(CLI::App& command, ForeignSource& source) {
  command.add_option(
      "--track", source.track,
      "Instead of a flight folder: the track as another program wrote it, CSV, .pos of RTKLIB or a log "
      "of NMEA or UBX (docs/formats.md)");
  command.add_option("--ranges", source.ranges,
                     "The ranges as another program wrote them, CSV; without --track each has a pose");
  command.add_option("--mapping", source.mapping,
                     "JSON file with the names of columns and the options below");
  command.add_option("--column", source.columns,
                     "track.FIELD=NAME or ranges.FIELD=NAME: meaning of a column");
  command.add_flag("--column-for-each-anchor", source.column_for_each_anchor,
                   "There is one column of ranges for each anchor, named by the anchor");
  for (const auto& setting : k_settings) {
    const std::string option = std::string("--") + setting.name;
    if (command.get_option_no_throw(option) != nullptr) continue;
    if (setting.name == k_lever_arm) {
      command
          .add_option_function<std::vector<std::string>>(
              option,
              [&source](const std::vector<std::string>& arms) {
                std::string& all = source.settings[k_lever_arm];
                all.clear();
                for (const auto& arm : arms) all += (all.empty() ? "" : ";") + arm;
              },
              setting.help)
          ->allow_extra_args(false);
      continue;
    }
    command.add_option_function<std::string>(
        option, [&source, name = setting.name](const std::string& text) { source.settings[name] = text; },
        setting.help);
  }
}

Result<FlightData> read_foreign_source(const ForeignSource& source) {
  if (source.ranges.empty())
    return wrong("--track without --ranges: the ranges of the flight are needed, in a table of their own");
  ForeignOptions options;
  options.name = source.name();
  if (!source.mapping.empty()) {
    BOOST_OUTCOME_TRYV(read_mapping(source.mapping, options));
  }
  for (const auto& column : source.columns) {
    BOOST_OUTCOME_TRYV(read_column(column, options));
  }
  for (const auto& [key, text] : source.settings) {
    const auto read = read_setting(key, text, options);
    if (!read) return wrong("--" + read.error().message);
  }
  options.column_for_each_anchor = options.column_for_each_anchor || source.column_for_each_anchor;
  BOOST_OUTCOME_TRY(auto ranges, ForeignTable::read(source.ranges));
  std::optional<ForeignTable> track;
  if (!source.track.empty()) {
    BOOST_OUTCOME_TRY(track, is_gnss_log(source.track) ? table_of_log(source.track, options.epoch_us)
                                                       : ForeignTable::read(source.track));
  }
  return read_foreign_flight(track, std::move(ranges), options);
}

}  // namespace anchord::cli
