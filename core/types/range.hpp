#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"

namespace anchord {

enum class RangeKind : std::uint8_t { tag_anchor, anchor_anchor };
inline constexpr auto k_range_kind_words = enum_table<RangeKind>(
    {{"tag_anchor", RangeKind::tag_anchor}, {"anchor_anchor", RangeKind::anchor_anchor}});

/// Channel impulse response as read from the radio: interleaved re, im.
struct Cir {
  std::vector<std::int16_t> re_im;  ///< 2 n values
  double dt_ps{1001.6};             ///< tap spacing
  std::optional<double> first_path_idx{};
  std::optional<double> preamble_count{};  ///< RXPACC
};

/// Ground truth of a labelled measurement.
struct RangeTruth {
  std::optional<double> distance_m{};
  std::optional<bool> los{};
};

/// One exchange as received: immutable, never corrected in place. Identity: (mission, tag, antenna, anchor,
/// time, seq).
struct Range {
  MissionId mission{};
  RangeKind kind{RangeKind::tag_anchor};
  UtcTime time{};
  std::optional<UtcTime> received{};
  NetworkId tag{};          ///< the other anchor when kind == anchor_anchor
  std::uint8_t antenna{0};  ///< which antenna of the tag
  NetworkId anchor{};
  std::optional<std::uint64_t> seq{};
  double distance_m{};
  std::optional<double> rss_dbm{};
  std::optional<double> fp_dbm{};     ///< first-path power
  std::optional<double> rx_dbm{};     ///< total received power
  std::optional<double> std_noise{};  ///< DW1000 STD_NOISE register
  std::optional<double> heading_deg{};
  std::optional<RangeTruth> truth{};
  std::optional<Cir> cir{};
};

}  // namespace anchord
