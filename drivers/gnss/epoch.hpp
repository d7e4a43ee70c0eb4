#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/fix.hpp"

namespace anchord::gnss {

enum class Protocol : std::uint8_t { nmea, ubx, erb, llh, gpsd };
inline constexpr auto k_protocol_words = enum_table<Protocol>({{"nmea", Protocol::nmea},
                                                               {"ubx", Protocol::ubx},
                                                               {"erb", Protocol::erb},
                                                               {"llh", Protocol::llh},
                                                               {"gpsd", Protocol::gpsd}});
constexpr std::string_view to_string(Protocol protocol) { return k_protocol_words.word(protocol); }

/// One position epoch of a receiver, whatever it speaks. Absent means unknown: no zeros, no NaN.
/// With fix none there is no position, even where the receiver still prints an old one.
struct Epoch {
  std::string receiver{};  ///< where one wire brings several (gpsd): its name there
  Protocol protocol{Protocol::nmea};
  std::optional<UtcTime> time{};                 ///< of measurement, leap seconds taken out
  std::optional<std::int64_t> time_of_day_ns{};  ///< UTC; for NMEA streams that never say the date
  std::optional<double> lat_deg{}, lon_deg{};
  std::optional<double> height_ellipsoid_m{},
      height_msl_m{};  ///< msl: of the receiver's own geoid, never mix makes
  FixClass fix{FixClass::none};
  std::optional<int> satellites{};
  std::optional<double> age_s{};                                ///< of the corrections
  std::optional<double> sigma_e_m{}, sigma_n_m{}, sigma_u_m{};  ///< 1 sigma
  std::optional<double> hdop{};
  std::optional<Eigen::Matrix3d> covariance_enu_m2{};  ///< full, where the format has it
  std::optional<Eigen::Vector3d> baseline_ned_m{};     ///< rover minus base (NAV-RELPOSNED, ERB RTK)
};

/// As the rest of the system stores it. Nothing without time, position and ellipsoidal height.
std::optional<Fix> to_fix(const Epoch& epoch, const MissionId& mission);

/// What was not used, by reason. Reasons come from a fixed set in the decoders, so this cannot grow without
/// bound.
class Skips {
 public:
  struct Entry {
    std::uint64_t count{};
    std::uint64_t first_offset{};  ///< of the stream, bytes
    std::string example;           ///< at most 160 printable characters of the first one
  };
  void count(std::string_view reason, std::uint64_t offset, std::string_view bytes = {}, std::uint64_t n = 1);
  const std::map<std::string, Entry, std::less<>>& entries() const { return entries_; }
  std::uint64_t operator[](std::string_view reason) const;

 private:
  std::map<std::string, Entry, std::less<>> entries_;
};

using Epochs = std::vector<Epoch>;

}  // namespace anchord::gnss
