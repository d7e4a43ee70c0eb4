#include "drivers/pozyx/values.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "drivers/pozyx/registers.hpp"

namespace anchord::pozyx {
namespace {

struct Preamble {
  std::uint8_t code;
  int symbols;
};
constexpr std::array k_preambles{Preamble{0x0c, 4096}, Preamble{0x28, 2048}, Preamble{0x18, 1536},
                                 Preamble{0x08, 1024}, Preamble{0x34, 512},  Preamble{0x24, 256},
                                 Preamble{0x14, 128},  Preamble{0x04, 64}};

bool channel_exists(int channel) { return channel >= 1 && channel <= 7 && channel != 6; }

}  // namespace

RangeInfo range_info(ByteView data) { return {u32_at(data, 0), u32_at(data, 4), i16_at(data, 8)}; }

RangeFault fault_of(const RangeInfo& info, const std::optional<RangeInfo>& previous) {
  if (info.distance_mm == 0) return RangeFault::zero_distance;
  if (info.distance_mm > 1'000'000) return RangeFault::too_far;
  if (info.rss_dbm < -120 || info.rss_dbm > -40) return RangeFault::rss_impossible;
  if (previous && previous->time_ms == info.time_ms) return RangeFault::stale;
  return RangeFault::none;
}

Result<UwbSettings> uwb_settings(ByteView four_registers) {
  UwbSettings settings;
  settings.channel = four_registers[0];
  settings.rate = four_registers[1] & 0x3f;
  const int prf = four_registers[1] >> 6;
  const auto* preamble = std::find_if(k_preambles.begin(), k_preambles.end(),
                                      [&](const Preamble& p) { return p.code == four_registers[2]; });
  if (!channel_exists(settings.channel) || settings.rate > 2 || prf < 1 || prf > 2 ||
      preamble == k_preambles.end()) {
    return make_error(Errc::bad_frame, "UWB registers " + hex(four_registers) + " are not valid");
  }
  settings.prf = prf == 1 ? Prf::mhz16 : Prf::mhz64;
  settings.preamble_symbols = preamble->symbols;
  settings.gain_db = four_registers[3] * 0.5;
  return settings;
}

Result<Bytes> uwb_registers(const UwbSettings& settings) {
  const auto* preamble = std::find_if(k_preambles.begin(), k_preambles.end(), [&](const Preamble& p) {
    return p.symbols == settings.preamble_symbols;
  });
  if (!channel_exists(settings.channel)) {
    return make_error(Errc::invalid_argument,
                      "channel " + std::to_string(settings.channel) + ": one of 1, 2, 3, 4, 5, 7");
  }
  if (settings.rate > 2) return make_error(Errc::invalid_argument, "rate: 0, 1 or 2");
  if (preamble == k_preambles.end()) {
    return make_error(Errc::invalid_argument,
                      "preamble of " + std::to_string(settings.preamble_symbols) +
                          " symbols: one of 64, 128, 256, 512, 1024, 1536, 2048, 4096");
  }
  if (settings.gain_db && !(*settings.gain_db >= 0 && *settings.gain_db <= 33.5))
    return make_error(Errc::invalid_argument, "gain: 0..33.5 dB");
  const auto prf = static_cast<std::uint8_t>(settings.prf == Prf::mhz16 ? 0x40 : 0x80);
  return Bytes{settings.channel, static_cast<std::uint8_t>(prf | settings.rate), preamble->code};
}

std::uint8_t gain_register(double gain_db) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(gain_db, 0.0, 33.5) * 2));
}

std::string to_string(const UwbSettings& s) {
  static constexpr std::array k_rates{"110 kbit/s", "850 kbit/s", "6.81 Mbit/s"};
  return "channel " + std::to_string(s.channel) + ", " + k_rates[std::min<std::size_t>(s.rate, 2)] +
         ", PRF " + (s.prf == Prf::mhz16 ? "16" : "64") + " MHz, " + std::to_string(s.preamble_symbols) +
         " symbols";
}

bool same_air(const UwbSettings& wanted, const UwbSettings& read) {
  if (wanted.channel != read.channel || wanted.rate != read.rate || wanted.prf != read.prf ||
      wanted.preamble_symbols != read.preamble_symbols) {
    return false;
  }
  return !wanted.gain_db || (read.gain_db && std::abs(*wanted.gain_db - *read.gain_db) <= 1.0);
}

std::size_t cir_taps(Prf prf) { return prf == Prf::mhz16 ? 992 : 1016; }

double exchange_s(const UwbSettings& settings) {
  constexpr std::array k_byte_s{73e-6, 9.4e-6, 1.2e-6};
  const double symbol_s = settings.prf == Prf::mhz16 ? 993.59e-9 : 1017.63e-9;
  const double frame_s =
      settings.preamble_symbols * symbol_s + 20 * k_byte_s[std::min<std::size_t>(settings.rate, 2)];
  return 3 * frame_s + 0.010;
}

std::string TagIdentity::firmware_text() const {
  return std::to_string(firmware >> 4) + "." + std::to_string(firmware & 15);
}

std::string TagIdentity::model() const {
  return std::string("Pozyx ") + (is_tag() ? "tag" : "anchor") + " 1." + std::to_string(hardware & 0x1f);
}

Result<Bytes> device_add_parameters(const DeviceInfo& device) {
  Bytes out;
  put_u16(out, device.id);
  out.push_back(device.anchor ? 1 : 2);
  for (const double metres : device.local_m) {
    const double mm = metres * 1000.0;
    if (!(std::abs(mm) <= 2147483647.0)) {  // false for NaN
      return make_error(Errc::invalid_argument, "coordinate " + std::to_string(metres) +
                                                    " m is too large: give positions in a local frame");
    }
    put_u32(out, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::llround(mm))));
  }
  return out;
}

Eigen::Vector3d coordinates_m(ByteView data) {
  return {i32_at(data, 0) * 1e-3, i32_at(data, 4) * 1e-3, i32_at(data, 8) * 1e-3};
}

std::optional<double> absolute_heading_deg(std::int16_t euler_heading, std::uint8_t sensors_mode,
                                           std::uint8_t calib_status) {
  if (sensors_mode < 9 || sensors_mode > 12 || (calib_status & 3) != 3) return std::nullopt;
  const double deg = euler_heading / 16.0;
  if (deg < 0 || deg > 360) return std::nullopt;
  return deg == 360 ? 0 : deg;
}

Result<void> check_firmware(std::uint8_t firmware) {
  if (firmware >= 0x10) return boost::outcome_v2::success();
  char text[120];
  std::snprintf(text, sizeof text,
                "firmware register 0x%02x is older than 1.0, with another command set: update it", firmware);
  return make_error(Errc::unsupported, text);
}

}  // namespace anchord::pozyx
