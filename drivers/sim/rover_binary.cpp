#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>

#include "drivers/sim/rover_formats.hpp"
#include "drivers/sim/rover_time.hpp"

// UBX and ERB, little endian, laid out as in the makers' tables.

namespace anchord::sim {
namespace {

template <class T>
void put(std::string& out, T value) {
  static_assert(std::endian::native == std::endian::little);
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.append(bytes, sizeof value);
}
std::int32_t scaled(double value, double unit) {
  return static_cast<std::int32_t>(std::llround(value / unit));
}
std::uint32_t count(double value, double unit) {
  return static_cast<std::uint32_t>(std::clamp(std::llround(value / unit), 0LL, 4294967295LL));
}

/// The 8-bit Fletcher pair of both makers.
void sum(std::string& frame, std::size_t from) {
  std::uint8_t a = 0, b = 0;
  for (std::size_t i = from; i < frame.size(); ++i) {
    a = static_cast<std::uint8_t>(a + static_cast<std::uint8_t>(frame[i]));
    b = static_cast<std::uint8_t>(b + a);
  }
  frame += static_cast<char>(a);
  frame += static_cast<char>(b);
}

double horizontal_m(const RoverEpoch& epoch) {
  return std::hypot(epoch.sigma_enu_m.x(), epoch.sigma_enu_m.y());
}
double signed_course_deg(const RoverEpoch& epoch) {
  return std::atan2(epoch.velocity_enu_mps.x(), epoch.velocity_enu_mps.y()) * 180 / std::numbers::pi;
}
bool located(const RoverEpoch& epoch) { return epoch.fix != FixClass::none; }

std::string nav_pvt(const RoverEpoch& epoch) {
  // Whole seconds rounded, so that nano is negative in the second half: as receivers do.
  const std::int64_t second = (epoch.time.ns + 500'000'000) / 1'000'000'000;
  const CivilTime at = civil(UtcTime{second * 1'000'000'000});
  const bool ok = located(epoch);
  const Wgs84 p = ok ? epoch.position : Wgs84{};
  const Eigen::Vector3d& v = epoch.velocity_enu_mps;
  std::string m;
  put<std::uint32_t>(m, gps_time(epoch.time).tow_ms);
  put<std::uint16_t>(m, static_cast<std::uint16_t>(at.year));
  for (const int part : {at.month, at.day, at.hour, at.minute, at.second})
    put(m, static_cast<std::uint8_t>(part));
  put<std::uint8_t>(m, 0x37);  // date, time, fully resolved
  put<std::uint32_t>(m, 25);
  put<std::int32_t>(m, static_cast<std::int32_t>(epoch.time.ns - second * 1'000'000'000));
  put<std::uint8_t>(m, ok ? 3 : 0);
  const int carrier = epoch.fix == FixClass::rtk_fixed ? 2 : epoch.fix == FixClass::rtk_float ? 1 : 0;
  put<std::uint8_t>(m, static_cast<std::uint8_t>((ok ? 1 : 0) | (carrier > 0 ? 2 : 0) | carrier << 6));
  put<std::uint8_t>(m, 0);
  put<std::uint8_t>(m, static_cast<std::uint8_t>(epoch.satellites));
  put<std::int32_t>(m, scaled(p.lon_deg, 1e-7));
  put<std::int32_t>(m, scaled(p.lat_deg, 1e-7));
  put<std::int32_t>(m, scaled(p.height_m, 1e-3));
  put<std::int32_t>(m, ok ? scaled(p.height_m - epoch.geoid_separation_m, 1e-3) : 0);
  put<std::uint32_t>(m, count(horizontal_m(epoch), 1e-3));
  put<std::uint32_t>(m, count(epoch.sigma_enu_m.z(), 1e-3));
  put<std::int32_t>(m, scaled(v.y(), 1e-3));
  put<std::int32_t>(m, scaled(v.x(), 1e-3));
  put<std::int32_t>(m, scaled(-v.z(), 1e-3));
  put<std::int32_t>(m, scaled(v.head<2>().norm(), 1e-3));
  put<std::int32_t>(m, scaled(std::fmod(signed_course_deg(epoch) + 360, 360), 1e-5));
  put<std::uint32_t>(m, 50);
  put<std::uint32_t>(m, 180'000);
  put<std::uint16_t>(m, 170);
  // Class of the corrections' age: 2 is 1 to 2 s, 1 is below.
  put<std::uint16_t>(m, static_cast<std::uint16_t>(carrier == 0 ? 0 : (epoch.age_s < 1 ? 1 : 2) << 1));
  m.append(4, '\0');
  put<std::int32_t>(m, 0);
  put<std::int16_t>(m, 0);
  put<std::uint16_t>(m, 0);
  return ubx_frame(0x01, 0x07, m);
}

std::string nav_hpposllh(const RoverEpoch& epoch) {
  std::string m;
  m.append(3, '\0');
  put<std::uint8_t>(m, located(epoch) ? 0 : 1);
  put<std::uint32_t>(m, gps_time(epoch.time).tow_ms);
  const Wgs84 p = located(epoch) ? epoch.position : Wgs84{};
  const double msl_m = located(epoch) ? p.height_m - epoch.geoid_separation_m : 0;
  struct Part {
    std::int32_t whole;
    std::int8_t rest;
  };
  // The small part is signed: the large one is the nearest, not the one below.
  const auto split = [](double value, double unit, int of) {
    const std::int64_t all = std::llround(value / unit);
    const std::int64_t whole = std::llround(static_cast<double>(all) / of);
    return Part{static_cast<std::int32_t>(whole), static_cast<std::int8_t>(all - whole * of)};
  };
  const Part lon = split(p.lon_deg, 1e-9, 100), lat = split(p.lat_deg, 1e-9, 100);
  const Part height = split(p.height_m, 1e-4, 10), msl = split(msl_m, 1e-4, 10);
  for (const Part& part : {lon, lat, height, msl}) put<std::int32_t>(m, part.whole);
  for (const Part& part : {lon, lat, height, msl}) put<std::int8_t>(m, part.rest);
  put<std::uint32_t>(m, count(horizontal_m(epoch), 1e-4));
  put<std::uint32_t>(m, count(epoch.sigma_enu_m.z(), 1e-4));
  return ubx_frame(0x01, 0x14, m);
}

std::string nav_cov(const RoverEpoch& epoch) {
  std::string m;
  put<std::uint32_t>(m, gps_time(epoch.time).tow_ms);
  put<std::uint8_t>(m, 0);
  put<std::uint8_t>(m, located(epoch) ? 1 : 0);
  put<std::uint8_t>(m, 0);
  m.append(9, '\0');
  const Eigen::Vector3d variance = epoch.sigma_enu_m.cwiseProduct(epoch.sigma_enu_m);
  for (const double value : {variance.y(), 0.0, 0.0, variance.x(), 0.0, variance.z()})  // NN NE ND EE ED DD
    put<float>(m, static_cast<float>(value));
  m.append(24, '\0');
  return ubx_frame(0x01, 0x36, m);
}

}  // namespace

std::string ubx_frame(std::uint8_t message_class, std::uint8_t id, std::string_view payload) {
  std::string out{'\xb5', '\x62', static_cast<char>(message_class), static_cast<char>(id)};
  put<std::uint16_t>(out, static_cast<std::uint16_t>(payload.size()));
  out += payload;
  sum(out, 2);
  return out;
}

std::string erb_frame(std::uint8_t id, std::string_view payload) {
  std::string out{'E', 'R', static_cast<char>(id)};
  put<std::uint16_t>(out, static_cast<std::uint16_t>(payload.size()));
  out += payload;
  sum(out, 2);
  return out;
}

std::string encode_ubx(const RoverEpoch& epoch) {
  return nav_pvt(epoch) + nav_hpposllh(epoch) + nav_cov(epoch);
}

std::string encode_erb(const RoverEpoch& epoch) {
  const GpsTime at = gps_time(epoch.time);
  const bool ok = located(epoch);
  const Wgs84 p = ok ? epoch.position : Wgs84{};
  const auto message = [&] {
    std::string m;
    put<std::uint32_t>(m, at.tow_ms);
    return m;
  };
  std::string ver = message(), pos = message(), stat = message(), dops = message(), vel = message(),
              svi = message(), rtk;
  for (const char part : {'\0', '\1', '\0'}) ver += part;
  put<double>(pos, p.lon_deg);
  put<double>(pos, p.lat_deg);
  put<double>(pos, p.height_m);
  put<double>(pos, ok ? p.height_m - epoch.geoid_separation_m : 0);
  // Of ECEF axes at the maker: only their common length means anything, and that is kept.
  put<std::uint32_t>(pos, ok ? count(horizontal_m(epoch), 1e-3) : 0);
  put<std::uint32_t>(pos, ok ? count(epoch.sigma_enu_m.z(), 1e-3) : 0);
  put<std::uint16_t>(stat, static_cast<std::uint16_t>(at.week));
  const int fix = !ok ? 0 : epoch.fix == FixClass::rtk_fixed ? 3 : epoch.fix == FixClass::rtk_float ? 2 : 1;
  for (const int part : {fix, ok ? 1 : 0, epoch.satellites}) stat += static_cast<char>(part);
  for (const double dop : {2.1, 1.7, 1.4, epoch.hdop})
    put<std::uint16_t>(dops, static_cast<std::uint16_t>(std::lround(dop * 100)));
  const Eigen::Vector3d& v = epoch.velocity_enu_mps;
  for (const double speed : {v.y(), v.x(), -v.z()}) put<std::int32_t>(vel, scaled(speed, 0.01));
  put<std::uint32_t>(vel, count(v.head<2>().norm(), 0.01));
  put<std::int32_t>(vel, scaled(signed_course_deg(epoch), 1e-5));
  put<std::uint32_t>(vel, 0);
  svi += '\0';
  rtk += static_cast<char>(epoch.satellites);
  put<std::uint16_t>(rtk, static_cast<std::uint16_t>(fix > 1 ? std::lround(epoch.age_s * 100) : 0));
  rtk.append(12, '\0');
  put<std::uint16_t>(rtk, fix == 3 ? 125 : 0);
  put<std::uint16_t>(rtk, static_cast<std::uint16_t>(at.week));
  put<std::uint32_t>(rtk, at.tow_ms / 1000);  // in seconds, as the encoder really does
  return erb_frame(1, ver) + erb_frame(2, pos) + erb_frame(3, stat) + erb_frame(4, dops) + erb_frame(5, vel) +
         erb_frame(6, svi) + erb_frame(7, rtk);
}

}  // namespace anchord::sim
