#include "api/formats/flight_folder.hpp"

#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <numbers>
#include <string>
#include <string_view>

#include "api/formats/csv_table.hpp"
#include "api/formats/flight_json.hpp"
#include "api/formats/globe_track.hpp"
#include "api/wire/exclusion_json.hpp"
#include "api/wire/row_limits.hpp"
#include "core/base/text.hpp"

namespace anchord {
namespace {

constexpr std::uintmax_t k_most_exclusion_bytes = 64u << 20;

UtcTime time_of(UtcTime epoch, double t_s) { return {epoch.ns + std::llround(t_s * 1e9)}; }

/// Instants a 64-bit nanosecond can hold, with room: |t_s| below 200 years.
Result<UtcTime> read_time(const CsvTable& table, std::size_t column, UtcTime epoch) {
  BOOST_OUTCOME_TRY(const double t_s, table.number(column));
  if (!std::isfinite(t_s) || std::abs(t_s) > 6e9) return table.error("t_s is not a time");
  return time_of(epoch, t_s);
}

/// Columns that hold a pose, in the track or in the ranges.
class PoseColumns {
 public:
  static Result<PoseColumns> of(const CsvTable& table, const FlightDeclaration& flight) {
    PoseColumns c;
    c.globe_ = flight.mission.frame == TrackFrame::wgs84;
    c.other_system_ = flight.source.has_value();
    c.heading_add_deg_ = flight.heading_add_deg;
    constexpr std::array<const char*, 3> globe{"lat_deg", "lon_deg", "alt_m"};
    constexpr std::array<const char*, 3> local{"x_m", "y_m", "z_m"};
    for (std::size_t i = 0; i < 3; ++i) {
      BOOST_OUTCOME_TRY(c.position_[i], table.require(c.globe_ ? globe[i] : local[i]));
    }
    if (flight.quaternion) {
      constexpr std::array<const char*, 4> names{"qx", "qy", "qz", "qw"};
      for (std::size_t i = 0; i < 4; ++i) {
        BOOST_OUTCOME_TRY(const std::size_t at, table.require(names[i]));
        c.quaternion_[i] = at;
      }
    } else if (!flight.heading_column.empty()) {
      BOOST_OUTCOME_TRY(const std::size_t at, table.require(flight.heading_column));
      c.heading_ = at;
    }
    c.fix_ = table.column("fix");
    c.sd_h_ = table.column("sd_h_m");
    c.sd_v_ = table.column("sd_v_m");
    c.age_ = table.column("correction_age_s");
    c.satellites_ = table.column("satellites");
    return c;
  }

  bool has_fix_class() const { return fix_.has_value(); }

  /// Nothing: the pose is not finite, or its standard deviations are none. Errors name the line.
  Result<std::optional<Fix>> read(const CsvTable& table, UtcTime time) const {
    Fix fix;
    fix.time = time;
    fix.frame = globe_ ? TrackFrame::wgs84 : TrackFrame::local;
    std::array<double, 3> p{};
    for (std::size_t i = 0; i < 3; ++i) {
      BOOST_OUTCOME_TRY(p[i], table.number(position_[i]));
      if (!std::isfinite(p[i])) return std::optional<Fix>{};
    }
    if (globe_) {
      if (std::abs(p[0]) > 90 || std::abs(p[1]) > 180)
        return table.error(
            "lat_deg or lon_deg outside the globe; metres of a map are frame crs of flight.json, in x_m, "
            "y_m, "
            "z_m");
      fix.position = {p[0], p[1], p[2]};
    } else {
      fix.local_m = {p[0], p[1], p[2]};
      if (!other_system_ && is_of_a_map(fix.local_m))
        return table.error(std::string("x_m, y_m, z_m are ") + k_of_a_map +
                           ": frame crs and crs in track of flight.json (docs/formats.md)");
    }
    BOOST_OUTCOME_TRY(fix.fix, fix_class(table));
    BOOST_OUTCOME_TRY(const auto sd_h, table.number(sd_h_));
    BOOST_OUTCOME_TRY(const auto sd_v, table.number(sd_v_));
    for (const auto& sigma : {sd_h, sd_v})
      if (sigma && !api::row_limits::k_sigma_m.hold(*sigma)) return std::optional<Fix>{};
    if (sd_h) {
      const double up = sd_v.value_or(1.5 * *sd_h);
      fix.covariance_m2 = Eigen::Vector3d(*sd_h * *sd_h, *sd_h * *sd_h, up * up).asDiagonal().toDenseMatrix();
    }
    if (quaternion_[0]) {
      std::array<double, 4> q{};
      for (std::size_t i = 0; i < 4; ++i) {
        BOOST_OUTCOME_TRY(q[i], table.number(*quaternion_[i]));
      }
      const Eigen::Quaterniond body(q[3], q[0], q[1], q[2]);
      if (!(std::abs(body.norm() - 1.0) < 0.1)) return table.error("qx, qy, qz, qw is not a unit quaternion");
      fix.enu_from_body = body.normalized();
    } else if (heading_) {
      BOOST_OUTCOME_TRY(const double heading_deg, table.number(*heading_));
      if (!std::isfinite(heading_deg)) return std::optional<Fix>{};
      const double yaw = (heading_deg + heading_add_deg_) * std::numbers::pi / 180.0;
      fix.enu_from_body = Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
    }
    BOOST_OUTCOME_TRY(fix.correction_age_s, table.number(age_));
    BOOST_OUTCOME_TRY(const auto satellites, table.number(satellites_));
    if (satellites && *satellites >= 0 && *satellites < 1000) fix.satellites = static_cast<int>(*satellites);
    return std::optional<Fix>{fix};
  }

 private:
  Result<FixClass> fix_class(const CsvTable& table) const {
    if (!fix_) return FixClass::rtk_fixed;  // motion capture has no such column
    const auto text = table.text(*fix_);
    for (const auto& [digit, fix] :
         {std::pair{"2", FixClass::rtk_fixed}, {"1", FixClass::rtk_float}, {"0", FixClass::single}}) {
      if (text == digit) return fix;
    }
    if (const auto fix = k_fix_words.find(text)) return *fix;
    return table.error("fix: '" + to_utf8(table.text(*fix_), 20) +
                       "', expected 2 (fixed), 1 (float), 0 (neither), or fixed, float, dgps, single, none");
  }

  bool globe_{false}, other_system_{false};
  double heading_add_deg_{0};
  std::array<std::size_t, 3> position_{};
  std::array<std::optional<std::size_t>, 4> quaternion_{};
  std::optional<std::size_t> heading_, fix_, sd_h_, sd_v_, age_, satellites_;
};

void note_unknown(const CsvTable& table, const std::string& file,
                  std::initializer_list<std::string_view> known, const FlightDeclaration& flight,
                  FlightData& data) {
  constexpr std::array<std::string_view, 17> pose{
      "t_s",    "lat_deg",          "lon_deg",    "alt_m", "x_m", "y_m", "z_m", "fix", "sd_h_m",
      "sd_v_m", "correction_age_s", "satellites", "qx",    "qy",  "qz",  "qw",  ""};
  std::string unused;
  for (const auto& name : table.header()) {
    bool is_known = name == flight.heading_column;
    for (const auto k : pose) is_known = is_known || k == name;
    for (const auto k : known) is_known = is_known || k == name;
    if (!is_known) unused += (unused.empty() ? "" : ", ") + name;
  }
  if (!unused.empty()) data.notes.push_back(file + ": columns not used: " + unused);
}

Result<void> read_track(const std::filesystem::path& folder, const FlightDeclaration& flight,
                        FlightData& data) {
  BOOST_OUTCOME_TRY(auto table, CsvTable::open(folder, "track"));
  BOOST_OUTCOME_TRY(const std::size_t t, table.require("t_s"));
  BOOST_OUTCOME_TRY(const auto pose, PoseColumns::of(table, flight));
  note_unknown(table, "track", {}, flight, data);
  if (!pose.has_fix_class() && (flight.mission.frame == TrackFrame::wgs84 || flight.source)) {
    data.notes.push_back("track: no column fix, every position is used as RTK fixed");
  }
  std::size_t not_finite = 0;
  while (true) {
    BOOST_OUTCOME_TRY(const bool more, table.next());
    if (!more) break;
    BOOST_OUTCOME_TRY(const UtcTime time, read_time(table, t, flight.epoch));
    BOOST_OUTCOME_TRY(const auto fix, pose.read(table, time));
    if (fix) {
      data.fixes.push_back(*fix);
    } else {
      ++not_finite;
    }
  }
  if (not_finite > 0)
    data.notes.push_back(
        "track: " + std::to_string(not_finite) +
        " rows without a finite pose, or with a standard deviation outside 0.00001 to 1000 m, "
        "were left out");
  return boost::outcome_v2::success();
}

Result<void> read_ranges(const std::filesystem::path& folder, const FlightDeclaration& flight,
                         FlightData& data) {
  BOOST_OUTCOME_TRY(auto table, CsvTable::open(folder, "ranges"));
  BOOST_OUTCOME_TRY(const std::size_t t, table.require("t_s"));
  BOOST_OUTCOME_TRY(const std::size_t anchor, table.require("anchor_id"));
  BOOST_OUTCOME_TRY(const std::size_t distance, table.require("range_m"));
  const auto tag = table.column("tag_id");
  const auto antenna = table.column("antenna");
  const auto rx = table.column("rx_dbm");
  const auto fp = table.column("fp_dbm");
  const auto rss = table.column("rss_dbm");
  const auto seq = table.column("seq");
  const auto kind = table.column("kind");
  std::optional<PoseColumns> pose;
  if (flight.track_in_ranges) {
    BOOST_OUTCOME_TRY(pose, PoseColumns::of(table, flight));
  }
  note_unknown(table, "ranges",
               {"anchor_id", "range_m", "tag_id", "antenna", "rx_dbm", "fp_dbm", "rss_dbm", "seq", "kind"},
               flight, data);
  const auto& tags = flight.mission.tags;
  if (!tag && tags.size() > 1) {
    return make_error(Errc::invalid_argument,
                      folder.string() + ": flight.json declares " + std::to_string(tags.size()) +
                          " tag antennas, ranges has no column tag_id to distinguish them");
  }
  std::size_t pose_not_finite = 0;
  while (true) {
    BOOST_OUTCOME_TRY(const bool more, table.next());
    if (!more) break;
    Range range;
    BOOST_OUTCOME_TRY(range.time, read_time(table, t, flight.epoch));
    const std::string id(table.text(anchor));
    if (id.empty()) return table.error("anchor_id is empty");
    range.anchor = network_id_of(id);
    data.anchor_names.try_emplace(range.anchor, id);
    BOOST_OUTCOME_TRY(range.distance_m, table.number(distance));
    if (tag) {
      range.tag = network_id_of(table.text(*tag));
    } else if (!tags.empty()) {
      range.tag = tags.front().tag;
    }
    BOOST_OUTCOME_TRY(const auto antenna_number, table.number(antenna));
    if (antenna_number) {
      if (!(*antenna_number >= 0 && *antenna_number <= 255)) return table.error("antenna must be 0 to 255");
      range.antenna = static_cast<std::uint8_t>(*antenna_number);
    } else if (!tag && !tags.empty()) {
      range.antenna = tags.front().antenna;
    }
    BOOST_OUTCOME_TRY(range.rx_dbm, table.number(rx));
    BOOST_OUTCOME_TRY(range.fp_dbm, table.number(fp));
    BOOST_OUTCOME_TRY(range.rss_dbm, table.number(rss));
    BOOST_OUTCOME_TRY(const auto number, table.number(seq));
    if (number && *number >= 0 && *number < 9e15) range.seq = static_cast<std::uint64_t>(*number);
    const std::string what = kind ? std::string(table.text(*kind)) : std::string();
    if (what == "anchor_anchor") {
      if (!tag)
        return table.error(
            "a range between anchors needs the other anchor in the column tag_id, and there is no such "
            "column");
      range.kind = RangeKind::anchor_anchor;
    } else if (!what.empty() && what != "tag_anchor") {
      return table.error("kind must be tag_anchor or anchor_anchor");
    }
    if (pose && range.kind == RangeKind::tag_anchor) {
      BOOST_OUTCOME_TRY(const auto fix, pose->read(table, range.time));
      if (fix) {
        data.fixes.push_back(*fix);
      } else {
        ++pose_not_finite;
      }
    }
    data.ranges.push_back(std::move(range));
  }
  if (pose_not_finite > 0) {
    data.notes.push_back("ranges: " + std::to_string(pose_not_finite) + " rows without a finite pose");
  }
  return boost::outcome_v2::success();
}

/// Which rows a person took out of use; a folder without the file has none.
Result<void> read_exclusions(const std::filesystem::path& file, FlightData& data) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) return boost::outcome_v2::success();
  const auto size = std::filesystem::file_size(file, ignored);
  if (ignored || size > k_most_exclusion_bytes)
    return make_error(Errc::invalid_argument, file.string() + ": larger than 64 MiB");
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  if (!in) return make_error(Errc::invalid_argument, file.string() + ": cannot be read");
  auto read = parse_exclusions_file(text);
  if (!read) return make_error(read.error().code, file.parent_path().string() + '/' + read.error().message);
  data.exclusions = std::move(read).value();
  return boost::outcome_v2::success();
}

}  // namespace

void leave_out_excluded(FlightData& flight) {
  flight.n_fixes_excluded +=
      std::erase_if(flight.fixes, [&](const Fix& fix) { return excluded(flight.exclusions, fix); });
  std::erase_if(flight.ranges, [&](const Range& range) {
    const bool out = excluded(flight.exclusions, range);
    if (out) ++flight.n_ranges_excluded[range.anchor];
    return out;
  });
}

Result<FlightData> read_flight_folder(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) {
    return make_error(Errc::not_found, folder.string() + ": not a folder");
  }
  BOOST_OUTCOME_TRY(const auto flight, read_flight_json(folder / "flight.json"));
  FlightData data;
  data.mission = flight.mission;
  if (!flight.track_in_ranges) {
    BOOST_OUTCOME_TRY(read_track(folder, flight, data));
  }
  BOOST_OUTCOME_TRY(read_ranges(folder, flight, data));
  if (flight.source) {
    const auto put = put_on_globe(data, *flight.source, AttitudeOf::axes);
    if (!put)
      return make_error(put.error().code,
                        (folder / "flight.json").string() + ": track: " + put.error().message);
  }
  BOOST_OUTCOME_TRY(read_exclusions(folder / "exclusions.json", data));
  return data;
}

}  // namespace anchord
