#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/organization_id.hpp"
#include "core/base/time.hpp"
#include "core/types/site_quota.hpp"

namespace anchord {

/// Whose sites these are: one customer among others of a centre.
struct Organization {
  OrganizationId id{};
  std::string name, description;
  UtcTime created{};
  std::uint64_t version{1};  ///< for ETag
};

/// What an administrator allows it: what all its sites may store together, and how often its tokens may ask.
struct OrganizationLimits {
  QuotaLimits<k_organization_quota_kinds> stored{};
  std::optional<std::uint32_t> requests_per_minute{};  ///< of all its tokens together
};

}  // namespace anchord
