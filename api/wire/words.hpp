#pragma once

#include "api/kit/word_table.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"

/// Words of enums of core on the wire, in files and on the command line: one table each, read and written by
/// it.
namespace anchord::api {

inline constexpr auto k_fix_words = std::to_array<Word<FixClass>>({{"none", FixClass::none},
                                                                   {"single", FixClass::single},
                                                                   {"dgps", FixClass::dgps},
                                                                   {"float", FixClass::rtk_float},
                                                                   {"fixed", FixClass::rtk_fixed}});
inline constexpr auto k_frame_words =
    std::to_array<Word<TrackFrame>>({{"wgs84", TrackFrame::wgs84}, {"local", TrackFrame::local}});
inline constexpr auto k_point_words =
    std::to_array<Word<TrackPoint>>({{"gnss_antenna", TrackPoint::gnss_antenna},
                                     {"body", TrackPoint::body},
                                     {"tag_antenna", TrackPoint::tag_antenna}});
inline constexpr auto k_range_kind_words = std::to_array<Word<RangeKind>>(
    {{"tag_anchor", RangeKind::tag_anchor}, {"anchor_anchor", RangeKind::anchor_anchor}});

}  // namespace anchord::api
