#pragma once

#include <optional>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/organization_id.hpp"
#include "core/base/result.hpp"
#include "core/types/anchor.hpp"
#include "core/types/site_quota.hpp"

namespace anchord {

/// Sites, in id order. Updates name the version they change: conflict when it moved on; the stored version
/// becomes expected_version + 1. Callable from any thread; errors as in measurement_store.hpp.
class SiteStore {
 public:
  virtual ~SiteStore() = default;
  virtual Result<void> insert(const Site& site) = 0;
  virtual Result<void> update(const Site& site, std::uint64_t expected_version) = 0;
  virtual Result<Site> site(const SiteId& id) = 0;
  /// Of one organization, where it is named.
  virtual Result<std::vector<Site>> sites(std::size_t limit, const std::optional<SiteId>& after,
                                          const std::optional<OrganizationId>& organization) = 0;
  virtual Result<void> remove(const SiteId& id, std::uint64_t expected_version) = 0;

  /// What the site may store, and what it stores now. The stores of missions, anchors and bundles hold to it,
  /// and to that of its organization: conflict, in the transaction that would go beyond. errors: not_found
  virtual Result<SiteQuota> quota(const SiteId& id) = 0;
  virtual Result<void> set_limits(const SiteId& id, const SiteLimits& limits) = 0;
};

}  // namespace anchord
