#include "drivers/sim/rover_formats.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <numbers>

#include "drivers/sim/rover_time.hpp"

namespace anchord::sim {
namespace {

__attribute__((format(printf, 1, 2))) std::string text(const char* format, ...) {
  std::array<char, 512> buffer{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer.data(), buffer.size(), format, arguments);
  va_end(arguments);
  return buffer.data();
}

double speed_mps(const RoverEpoch& e) { return e.velocity_enu_mps.head<2>().norm(); }
double course_deg(const RoverEpoch& e) {
  return std::fmod(std::atan2(e.velocity_enu_mps.x(), e.velocity_enu_mps.y()) * 180 / std::numbers::pi + 360,
                   360);
}

/// ddmm.mmmmmmm; minutes rounded as a whole, so that 60 never appears.
std::string angle(double degrees, int width) {
  const auto units = static_cast<long long>(std::llround(std::abs(degrees) * 60 * 1e7));
  const long long whole = units / 600'000'000, rest = units % 600'000'000;
  return text("%0*lld%02lld.%07lld", width, whole, rest / 10'000'000, rest % 10'000'000);
}

std::string encode_nmea(const RoverEpoch& e) {
  if (e.fix == FixClass::none) {  // the maker's way: everything empty, the time as well
    return nmea_frame("GNRMC,,,,,,,,,,,,") + nmea_frame("GNGGA,,,,,,,,,,,,,,") +
           nmea_frame("GNGST,,,,,,,,,") + nmea_frame("GNVTG,,,,,,,");
  }
  // To hundredths, rounded up into the next second as a whole.
  const CivilTime at = civil(UtcTime{(e.time.ns + 5'000'000) / 10'000'000 * 10'000'000});
  const std::string time =
      text("%02d%02d%02d.%02d", at.hour, at.minute, at.second, at.nanosecond / 10'000'000);
  const std::string date = text("%02d%02d%02d", at.day, at.month, at.year % 100);
  const Wgs84& p = e.position;
  const std::string where = angle(p.lat_deg, 2) + (p.lat_deg < 0 ? ",S," : ",N,") + angle(p.lon_deg, 3) +
                            (p.lon_deg < 0 ? ",W" : ",E");
  const bool fixed = e.fix == FixClass::rtk_fixed, rtk = fixed || e.fix == FixClass::rtk_float;
  const int quality = fixed ? 4 : rtk ? 5 : e.fix == FixClass::dgps ? 2 : 1;
  const double speed = speed_mps(e), knots = speed / 0.514444, kmh = speed * 3.6;
  const std::string course = speed < (fixed ? 0.3 : 0.5) ? std::string() : text("%.2f", course_deg(e));
  const std::string age = rtk ? text("%.1f", e.age_s) : std::string();
  const double msl_m = p.height_m - e.geoid_separation_m;
  const Eigen::Vector3d& s = e.sigma_enu_m;
  return nmea_frame("GNRMC," + time + ",A," + where + text(",%.2f,", knots) + course + "," + date +
                    (quality == 1 ? ",,,A" : ",,,D")) +
         nmea_frame("GNGGA," + time + "," + where +
                    text(",%d,%02d,%.1f,%.3f,M,%.3f,M,", quality, e.satellites, e.hdop, msl_m,
                         e.geoid_separation_m) +
                    age + ",") +
         nmea_frame("GNGST," + time + text(",0.400,,,,%.3f,%.3f,%.3f", s.x(), s.y(), s.z())) +
         nmea_frame("GNVTG," + course + text(",T,,M,%.2f,N,%.2f,K,%c", knots, kmh, fixed ? 'D' : 'A'));
}

std::string encode_llh(const RoverEpoch& e) {
  if (e.fix == FixClass::none) return {};
  const CivilTime at = civil(UtcTime{(e.time.ns + 500'000) / 1'000'000 * 1'000'000});
  const int q = e.fix == FixClass::rtk_fixed   ? 1
                : e.fix == FixClass::rtk_float ? 2
                : e.fix == FixClass::dgps      ? 4
                                               : 5;
  const Eigen::Vector3d& s = e.sigma_enu_m;
  return text(
      "%04d/%02d/%02d %02d:%02d:%02d.%03d %14.9f %14.9f %10.4f %3d %3d %8.4f %8.4f %8.4f %8.4f %8.4f %8.4f "
      "%6.2f %6.1f\n",
      at.year, at.month, at.day, at.hour, at.minute, at.second, at.nanosecond / 1'000'000, e.position.lat_deg,
      e.position.lon_deg, e.position.height_m, q, e.satellites, s.y(), s.x(), s.z(), 0.0, 0.0, 0.0,
      q <= 2 ? e.age_s : 0.0, q == 1 ? 12.5 : 0.0);
}

std::string encode_gpsd(const RoverEpoch& e) {
  const CivilTime at = civil(UtcTime{(e.time.ns + 500'000) / 1'000'000 * 1'000'000});
  const std::string time = text("%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", at.year, at.month, at.day, at.hour,
                                at.minute, at.second, at.nanosecond / 1'000'000);
  if (e.fix == FixClass::none)
    return "{\"class\":\"TPV\",\"device\":\"/dev/rover\",\"mode\":1,\"time\":\"" + time + "\"}\r\n";
  const char* status = e.fix == FixClass::rtk_fixed   ? "\"status\":3,"
                       : e.fix == FixClass::rtk_float ? "\"status\":4,"
                       : e.fix == FixClass::dgps      ? "\"status\":2,"
                                                      : "";  // absent for a plain position
  const double msl_m = e.position.height_m - e.geoid_separation_m;
  const std::string age = *status != 0 ? text(",\"dgpsAge\":%.1f", e.age_s) : std::string();
  const Eigen::Vector3d& s = e.sigma_enu_m;
  return text(
             "{\"class\":\"TPV\",\"device\":\"/dev/"
             "rover\",%s\"mode\":3,\"time\":\"%s\",\"ept\":0.005,\"lat\":%.9f,"
             "\"lon\":%.9f,\"altHAE\":%.4f,\"altMSL\":%.4f,\"alt\":%.4f,\"track\":%.4f,\"speed\":%.3f,"
             "\"climb\":%.3f,\"geoidSep\":%.3f,\"eph\":4.275%s}\r\n",
             status, time.c_str(), e.position.lat_deg, e.position.lon_deg, e.position.height_m, msl_m, msl_m,
             course_deg(e), speed_mps(e), e.velocity_enu_mps.z(), e.geoid_separation_m, age.c_str()) +
         text(
             "{\"class\":\"GST\",\"device\":\"/dev/"
             "rover\",\"time\":\"%s\",\"rms\":0.400,\"lat\":%.3f,\"lon\":%.3f,"
             "\"alt\":%.3f}\r\n",
             time.c_str(), s.y(), s.x(), s.z());
}

}  // namespace

CivilTime civil(UtcTime time) {
  using namespace std::chrono;
  const sys_time<nanoseconds> at{nanoseconds(time.ns)};
  const auto day = floor<days>(at);
  const year_month_day date(day);
  const hh_mm_ss<nanoseconds> clock(at - day);
  return {static_cast<int>(date.year()),
          static_cast<int>(static_cast<unsigned>(date.month())),
          static_cast<int>(static_cast<unsigned>(date.day())),
          static_cast<int>(clock.hours().count()),
          static_cast<int>(clock.minutes().count()),
          static_cast<int>(clock.seconds().count()),
          static_cast<int>(clock.subseconds().count())};
}

GpsTime gps_time(UtcTime time) {
  constexpr std::int64_t k_epoch_s = 315'964'800, k_week_ms = 604'800'000;  // 1980-01-06
  const std::int64_t ms = (time.ns + 500'000) / 1'000'000 + 18'000 - k_epoch_s * 1000;
  return {static_cast<int>(ms / k_week_ms), static_cast<std::uint32_t>(ms % k_week_ms)};
}

std::string nmea_frame(std::string_view body) {
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  return "$" + std::string(body) + text("*%02X\r\n", sum);
}

std::string encode(const RoverEpoch& epoch, RoverFormat format) {
  switch (format) {
    case RoverFormat::nmea:
      return encode_nmea(epoch);
    case RoverFormat::ubx:
      return encode_ubx(epoch);
    case RoverFormat::erb:
      return encode_erb(epoch);
    case RoverFormat::llh:
      return encode_llh(epoch);
    case RoverFormat::gpsd:
      return encode_gpsd(epoch);
  }
  return {};
}

std::string greeting(RoverFormat format) {
  if (format == RoverFormat::gpsd)
    return "{\"class\":\"VERSION\",\"release\":\"3.22\",\"rev\":\"3.22\",\"proto_major\":3,\"proto_minor\":"
           "14}\r\n";
  if (format == RoverFormat::llh)
    return "%  UTC                   latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
           "sdu(m)  "
           "sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n";
  return {};
}

std::string gpsd_answer(std::string_view command, std::string_view device) {
  if (command.starts_with("?WATCH")) {
    return "{\"class\":\"DEVICES\",\"devices\":[{\"class\":\"DEVICE\",\"path\":\"" + std::string(device) +
           "\",\"driver\":\"NMEA0183\"}]}\r\n{\"class\":\"WATCH\",\"enable\":" +
           (command.find("\"enable\":false") == std::string_view::npos ? "true" : "false") +
           ",\"json\":true,\"nmea\":false,\"raw\":0,\"scaled\":false,\"timing\":false,\"split24\":false,"
           "\"pps\":false}\r\n";
  }
  if (command.starts_with("?VERSION")) return greeting(RoverFormat::gpsd);
  return "{\"class\":\"ERROR\",\"message\":\"Unrecognized request\"}\r\n";
}

}  // namespace anchord::sim
