#pragma once

#include <optional>

#include "core/types/site_quota.hpp"
#include "server/storage/sql.hpp"

/// What a site may store, asked in the transaction that stores it.
namespace anchord::sql {

SiteQuota read_quota(Connection& connection, const SiteId& site);
void write_limits(Connection& connection, const SiteId& site, const SiteLimits& limits);

/// Why so much more of each kind may not come into a site; of what comes 0 of, no limit is asked. Counts
/// nothing where the site has no limits.
std::optional<Error> beyond_quota(Connection& connection, const std::optional<SiteId>& site,
                                  const SiteCounts& more);
/// The same of what is there already, in this transaction.
std::optional<Error> beyond_quota_now(Connection& connection, const SiteId& site, const SiteCounts& added);

/// Ranges and fixes of a flight.
std::uint64_t count_measurements(Connection& connection, std::int64_t mission_key);

}  // namespace anchord::sql
