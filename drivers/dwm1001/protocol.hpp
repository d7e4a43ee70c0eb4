#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::dwm1001 {

/// One distance of a tag to an anchor, as the module says it.
struct Distance {
  std::uint16_t anchor{};  ///< the last 16 bits of its node id
  double distance_m{};
  std::optional<int> quality{};  ///< percent; binary alone
};

/// A line of the shell command `les`, without its end:
///   022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 le_us=3082 est[6.97,5.17,-1.77,53]
/// Anchors with the positions they were given, metres; then time and estimate of the location engine, where
/// it is on. Modules at a high rate write lines into each other: one odd word rejects the line. Nothing: it
/// is no such line. errors: bad_frame
Result<std::optional<std::vector<Distance>>> parse_les(std::string_view line);

/// A line of `lep`: POS,7.10,5.24,-2.03,53. Position in the module's own frame and its quality in percent.
struct Estimate {
  double x_m{}, y_m{}, z_m{};
  int quality{};
};
std::optional<Estimate> parse_lep(std::string_view line);

/// "addr=xDECA1F2E3D4C022E" of `si`: the node's own id.
std::optional<std::uint64_t> node_id_in(std::string_view line);

/// Binary (TLV): the request dwm_loc_get, and what it is answered with:
///   40 01 ERR | 41 0D x y z (int32 mm) quality | 49 LEN N, N times: anchor u16, mm u32, quality u8, position
/// Little endian. 48 in place of 49: the module is an anchor.
std::string loc_get_request();
struct Location {
  int error{0};  ///< other than 0: refused, and nothing else is in it
  bool is_anchor{false};
  std::optional<Estimate> estimate{};
  std::vector<Distance> distances;
  std::size_t bytes{};  ///< of the answer
};
/// Nothing: not whole yet. errors: bad_frame
Result<std::optional<Location>> parse_location(std::string_view bytes);

}  // namespace anchord::dwm1001
