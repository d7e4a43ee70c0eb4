#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/enum_table.hpp"

namespace anchord {

/// What a quota of a site counts. Flights in the bin count too: their rows are stored.
enum class QuotaKind : std::uint8_t {
  missions,
  measurements,  ///< ranges and fixes
  anchors,
};
inline constexpr std::size_t k_quota_kinds = 3;
inline constexpr auto k_quota_kind_words = enum_table<QuotaKind>({{"missions", QuotaKind::missions},
                                                                  {"measurements", QuotaKind::measurements},
                                                                  {"anchors", QuotaKind::anchors}});

/// By kind.
using SiteCounts = std::array<std::uint64_t, k_quota_kinds>;
using SiteLimits = std::array<std::optional<std::uint64_t>, k_quota_kinds>;  ///< nothing: no limit

/// A limit that is reached refuses what is new: flights that start, imports, anchors that come into the site.
/// A flight that has started records on beyond it, and rows that come late for one are stored.
struct SiteQuota {
  SiteLimits limits{};
  SiteCounts used{};
  bool reached(QuotaKind kind) const {
    const auto i = static_cast<std::size_t>(kind);
    return limits[i] && used[i] >= *limits[i];
  }
};

}  // namespace anchord
