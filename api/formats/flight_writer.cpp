#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "api/formats/flight_folder.hpp"
#include "api/formats/flight_json.hpp"
#include "api/wire/exclusion_json.hpp"
#include "core/base/whole_file.hpp"

namespace anchord {
namespace {

/// Appends printf output to a file stream; rows are short.
template <class... Args>
void row(std::ofstream& out, const char* format, Args... args) {
  char text[512];
  const int size = std::snprintf(text, sizeof text, format, args...);
  if (size > 0) out.write(text, size);
}

/// Of a literal, so it ends with a 0.
const char* word(FixClass fix) { return k_fix_words.word(fix).data(); }

Result<void> write_track(const FlightData& flight, UtcTime epoch, bool attitude,
                         const std::filesystem::path& file) {
  WholeFile whole(file);
  auto& out = whole.out();
  const bool globe = flight.mission.frame == TrackFrame::wgs84;
  out << (globe ? "t_s,lat_deg,lon_deg,alt_m" : "t_s,x_m,y_m,z_m") << ",fix,sd_h_m,sd_v_m"
      << (attitude ? ",qx,qy,qz,qw" : "") << '\n';
  for (const Fix& fix : flight.fixes) {
    if (fix.frame != flight.mission.frame) {
      return make_error(Errc::invalid_argument, "a fix is not in the frame of its mission");
    }
    const double t_s = seconds_between(epoch, fix.time);
    // 1e-10 degrees are 0.01 mm.
    if (globe) {
      row(out, "%.6f,%.10f,%.10f,%.5f,%s", t_s, fix.position.lat_deg, fix.position.lon_deg,
          fix.position.height_m, word(fix.fix));
    } else {
      row(out, "%.6f,%.5f,%.5f,%.5f,%s", t_s, fix.local_m.x(), fix.local_m.y(), fix.local_m.z(),
          word(fix.fix));
    }
    if (fix.covariance_m2) {
      const auto& c = *fix.covariance_m2;
      row(out, ",%.4f,%.4f", std::sqrt(0.5 * (c(0, 0) + c(1, 1))), std::sqrt(c(2, 2)));
    } else {
      out << ",,";
    }
    if (attitude) {
      const auto q = fix.enu_from_body.value_or(Eigen::Quaterniond::Identity());
      row(out, ",%.7f,%.7f,%.7f,%.7f", q.x(), q.y(), q.z(), q.w());
    }
    out << '\n';
  }
  return whole.put_in_place();
}

Result<void> write_ranges(const FlightData& flight, UtcTime epoch, const std::filesystem::path& file) {
  WholeFile whole(file);
  auto& out = whole.out();
  const bool pairs = std::any_of(flight.ranges.begin(), flight.ranges.end(),
                                 [](const Range& r) { return r.kind == RangeKind::anchor_anchor; });
  out << "t_s,tag_id,antenna,anchor_id,range_m,rx_dbm,fp_dbm,rss_dbm,seq" << (pairs ? ",kind\n" : "\n");
  const auto optional = [&out](const std::optional<double>& value) {
    out << ',';
    if (value) row(out, "%.3f", *value);
  };
  for (const Range& range : flight.ranges) {
    const auto name = flight.anchor_names.find(range.anchor);
    row(out, "%.6f,%s,%u,%s,%.4f", seconds_between(epoch, range.time), to_string(range.tag).c_str(),
        static_cast<unsigned>(range.antenna),
        name != flight.anchor_names.end() ? name->second.c_str() : to_string(range.anchor).c_str(),
        range.distance_m);
    optional(range.rx_dbm);
    optional(range.fp_dbm);
    optional(range.rss_dbm);
    out << ',';
    if (range.seq) out << *range.seq;
    if (pairs) out << (range.kind == RangeKind::anchor_anchor ? ",anchor_anchor" : ",tag_anchor");
    out << '\n';
  }
  return whole.put_in_place();
}

}  // namespace

Result<void> write_flight_folder(const FlightData& flight, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return make_error(Errc::storage_unavailable, folder.string() + ": " + error.message());
  FlightDeclaration declaration;
  declaration.mission = flight.mission;
  UtcTime epoch = flight.fixes.empty() ? flight.mission.created : flight.fixes.front().time;
  epoch.ns -= epoch.ns % 1000;  // the declaration carries microseconds
  declaration.epoch = epoch;
  for (const Fix& fix : flight.fixes)
    declaration.quaternion = declaration.quaternion || fix.enu_from_body.has_value();
  BOOST_OUTCOME_TRY(write_flight_json(declaration, folder / "flight.json"));
  BOOST_OUTCOME_TRY(write_track(flight, epoch, declaration.quaternion, folder / "track.csv"));
  BOOST_OUTCOME_TRY(write_ranges(flight, epoch, folder / "ranges.csv"));
  if (flight.exclusions.empty()) return boost::outcome_v2::success();
  return write_whole(folder / "exclusions.json", exclusions_file_json(flight.exclusions));
}

}  // namespace anchord
