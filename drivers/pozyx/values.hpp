#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "drivers/pozyx/protocol.hpp"

/// What the bytes of registers and results mean. Pure.
namespace anchord::pozyx {

/// Result of DEVICE_GETRANGEINFO.
struct RangeInfo {
  std::uint32_t time_ms{};  ///< since the tag started; wraps after 49.7 days
  std::uint32_t distance_mm{};
  std::int16_t rss_dbm{};
  bool operator==(const RangeInfo&) const = default;
};
inline constexpr std::size_t k_range_info_bytes = 10;
RangeInfo range_info(ByteView data);

/// Why a successful exchange is not a range. Names are metric labels.
enum class RangeFault : std::uint8_t {
  none,
  zero_distance,  ///< 0 mm: the tag's failure value
  stale,          ///< the timestamp of the measurement before: nothing new was measured
  too_far,  ///< beyond any UWB link; 167772160 mm (0x0a000000) is what a tag shows for a device it never
            ///< ranged
  rss_impossible,  ///< 8192 dBm comes with the value above
};
inline constexpr auto k_range_fault_words =
    enum_table<RangeFault>({{"none", RangeFault::none},
                            {"zero_distance", RangeFault::zero_distance},
                            {"stale_range", RangeFault::stale},
                            {"distance_impossible", RangeFault::too_far},
                            {"rss_impossible", RangeFault::rss_impossible}});
constexpr std::string_view to_string(RangeFault fault) { return k_range_fault_words.word(fault); }
/// previous  info of the same device read before, if any
RangeFault fault_of(const RangeInfo& info, const std::optional<RangeInfo>& previous);

enum class Prf : std::uint8_t { mhz16, mhz64 };

/// Registers 1c..1f. Both ends of an exchange need the same, gain apart.
struct UwbSettings {
  std::uint8_t channel = 5;
  std::uint8_t rate = 0;  ///< 0 = 110 kbit/s, 1 = 850 kbit/s, 2 = 6.81 Mbit/s
  Prf prf = Prf::mhz64;
  int preamble_symbols = 4096;      ///< with 110 kbit/s and PRF 64 the dissertation's "accurate ranging"
  std::optional<double> gain_db{};  ///< 0..33.5 in half dB; absent: the tag's default of these settings
  bool operator==(const UwbSettings&) const = default;
};
/// errors: bad_frame (a code that no sheet names)
Result<UwbSettings> uwb_settings(ByteView four_registers);
/// Registers 1c, 1d, 1e; the gain is written apart, after them, because writing them resets it.
/// errors: invalid_argument, naming what cannot be set
Result<Bytes> uwb_registers(const UwbSettings& settings);
std::uint8_t gain_register(double gain_db);
std::string to_string(const UwbSettings& settings);
/// Same air interface, and a gain within what a tag may read back: one step lower than written (issue 22 of
/// the maker's library), so a step of one or two half dB counts as the same.
bool same_air(const UwbSettings& wanted, const UwbSettings& read);
/// Taps of the accumulator: 1016 at PRF 64 MHz; 992 at 16, where the maker writes 996 and the DW1000 itself
/// has 992.
std::size_t cir_taps(Prf prf);
/// How long one exchange may take on the air.
/// Inferred, not published: three frames of the precision protocol with preamble, start delimiter and some
/// 20 bytes each, and processing between them; 25..60 ms with the thesis settings.
double exchange_s(const UwbSettings& settings);

struct TagIdentity {
  std::uint8_t firmware{}, hardware{}, selftest{};
  std::uint16_t id{};
  bool is_tag() const { return (hardware & 0xe0) == 0x20; }
  std::string firmware_text() const;  ///< "1.3"
  std::string model() const;          ///< "Pozyx tag 1.3"
};

struct DeviceInfo {
  std::uint16_t id{};
  bool anchor{};
  Eigen::Vector3d local_m{0, 0, 0};
};
/// Parameters of DEVICE_ADD, 15 bytes: nearest millimetre. errors: invalid_argument beyond +-2147 km or not
/// finite
Result<Bytes> device_add_parameters(const DeviceInfo& device);
/// Millimetres of three i32. errors: bad_frame
Eigen::Vector3d coordinates_m(ByteView twelve_bytes);

/// Register 66: heading 0..360 degrees. Clockwise from north only when the sensors run a fusion mode with
/// the magnetometer (9..12) and CALIB_STATUS says it is calibrated; else an arbitrary zero: absent.
/// The sheet does not say which way the count grows; compass headings grow clockwise, as assumed here.
std::optional<double> absolute_heading_deg(std::int16_t euler_heading, std::uint8_t sensors_mode,
                                           std::uint8_t calib_status);

/// Firmware 0.9 has other function addresses. errors: unsupported
Result<void> check_firmware(std::uint8_t firmware);

}  // namespace anchord::pozyx
