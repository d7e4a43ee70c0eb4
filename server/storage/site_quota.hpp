#pragma once

#include <optional>

#include "core/types/organization.hpp"
#include "server/storage/sql.hpp"

/// What a site, and all sites of an organization together, may store, asked in the transaction that stores
/// it.
namespace anchord::sql {

SiteQuota read_quota(Connection& connection, const SiteId& site);
void write_limits(Connection& connection, const SiteId& site, const SiteLimits& limits);
OrganizationQuota read_quota(Connection& connection, const OrganizationId& organization);
OrganizationLimits read_limits(Connection& connection, const OrganizationId& organization);
void write_limits(Connection& connection, const OrganizationId& organization,
                  const OrganizationLimits& limits);

/// Why so much more of each kind may not come into a site, by its own quota or that of its organization; of
/// what comes 0 of, no limit is asked. Counts nothing where there are no limits.
/// from: the site that it leaves for this one
std::optional<Error> beyond_quota(Connection& connection, const std::optional<SiteId>& site,
                                  const SiteCounts& more, const std::optional<SiteId>& from = {});
/// The same of what is there already, in this transaction.
std::optional<Error> beyond_quota_now(Connection& connection, const SiteId& site, const SiteCounts& added);
/// The same of a site that comes into the organization with all that it stores.
std::optional<Error> beyond_quota(Connection& connection, const std::optional<OrganizationId>& organization,
                                  const SiteId& site);

/// Ranges and fixes of a flight.
std::uint64_t count_measurements(Connection& connection, std::int64_t mission_key);

}  // namespace anchord::sql
