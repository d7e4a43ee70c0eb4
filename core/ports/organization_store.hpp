#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/organization_id.hpp"
#include "core/base/result.hpp"
#include "core/types/organization.hpp"

namespace anchord {

/// Organizations, in id order; as SiteStore. Which sites are of one is written with the site.
class OrganizationStore {
 public:
  virtual ~OrganizationStore() = default;
  virtual Result<void> insert(const Organization& organization) = 0;
  virtual Result<void> update(const Organization& organization, std::uint64_t expected_version) = 0;
  virtual Result<Organization> organization(const OrganizationId& id) = 0;
  virtual Result<std::vector<Organization>> organizations(std::size_t limit,
                                                          const std::optional<OrganizationId>& after) = 0;
  /// conflict while it has sites, or tokens that were not revoked
  virtual Result<void> remove(const OrganizationId& id, std::uint64_t expected_version) = 0;

  /// What its sites store together, and what it is allowed. errors: not_found
  virtual Result<OrganizationQuota> quota(const OrganizationId& id) = 0;
  virtual Result<OrganizationLimits> limits(const OrganizationId& id) = 0;
  virtual Result<void> set_limits(const OrganizationId& id, const OrganizationLimits& limits) = 0;

  /// Of every site that is of one.
  virtual Result<std::vector<std::pair<OrganizationId, SiteId>>> members() = 0;
};

}  // namespace anchord
