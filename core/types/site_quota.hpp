#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/enum_table.hpp"

namespace anchord {

/// What a quota counts. Flights in the bin count too: their rows are stored.
enum class QuotaKind : std::uint8_t {
  missions,
  measurements,  ///< ranges and fixes
  anchors,
  sites,  ///< of an organization
};
inline constexpr std::size_t k_quota_kinds = 3;               ///< of a site
inline constexpr std::size_t k_organization_quota_kinds = 4;  ///< of all sites of an organization together
inline constexpr auto k_quota_kind_words = enum_table<QuotaKind>({{"missions", QuotaKind::missions},
                                                                  {"measurements", QuotaKind::measurements},
                                                                  {"anchors", QuotaKind::anchors},
                                                                  {"sites", QuotaKind::sites}});

template <std::size_t n>
using QuotaCounts = std::array<std::uint64_t, n>;  ///< by kind
template <std::size_t n>
using QuotaLimits = std::array<std::optional<std::uint64_t>, n>;  ///< by kind; nothing: no limit

/// A limit that is reached refuses what is new: flights that start, imports, anchors and sites that come in.
/// A flight that has started records on beyond it, and rows that come late for one are stored.
template <std::size_t n>
struct Quota {
  QuotaLimits<n> limits{};
  QuotaCounts<n> used{};
  bool reached(QuotaKind kind) const {
    const auto i = static_cast<std::size_t>(kind);
    return limits[i] && used[i] >= *limits[i];
  }
};

using SiteCounts = QuotaCounts<k_quota_kinds>;
using SiteLimits = QuotaLimits<k_quota_kinds>;
using SiteQuota = Quota<k_quota_kinds>;
using OrganizationQuota = Quota<k_organization_quota_kinds>;

}  // namespace anchord
