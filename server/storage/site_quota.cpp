#include "server/storage/site_quota.hpp"

namespace anchord::sql {
namespace {

/// Whose quota it is: how its limits and what it uses are read, and what is said of it.
template <std::size_t n>
struct Owner {
  const char *limits, *name;
  std::array<const char*, n> used;  ///< by kind
  std::string_view word, path;
};

// By what the appends counted, as in measurement_store.cpp.
constexpr Owner<k_quota_kinds> k_quota_site{
    "SELECT max_missions, max_measurements, max_anchors FROM site_quota WHERE site_id = ?1",
    "SELECT name FROM site WHERE id = ?1",
    {"SELECT count(*) FROM mission WHERE site_id = ?1",
     "SELECT (SELECT CAST(coalesce(sum(d.n_ranges), 0) AS BIGINT) / 2 FROM mission m JOIN device_seen d ON "
     "d.mission_key = m.mission_key WHERE m.site_id = ?1) + (SELECT CAST(coalesce(sum(k.n_fixes), 0) AS "
     "BIGINT) FROM mission m JOIN mission_fixes k ON k.mission_key = m.mission_key WHERE m.site_id = ?1)",
     "SELECT count(*) FROM anchor WHERE site_id = ?1"},
    "site",
    "sites"};
constexpr Owner<k_organization_quota_kinds> k_organization{
    "SELECT max_missions, max_measurements, max_anchors, max_sites FROM organization_quota WHERE "
    "organization_id = ?1",
    "SELECT name FROM organization WHERE id = ?1",
    {"SELECT count(*) FROM site s JOIN mission m ON m.site_id = s.id WHERE s.organization_id = ?1",
     "SELECT (SELECT CAST(coalesce(sum(d.n_ranges), 0) AS BIGINT) / 2 FROM site s JOIN mission m ON "
     "m.site_id = s.id JOIN device_seen d ON d.mission_key = m.mission_key WHERE s.organization_id = ?1) + "
     "(SELECT CAST(coalesce(sum(k.n_fixes), 0) AS BIGINT) FROM site s JOIN mission m ON m.site_id = s.id "
     "JOIN mission_fixes k ON k.mission_key = m.mission_key WHERE s.organization_id = ?1)",
     "SELECT count(*) FROM site s JOIN anchor a ON a.site_id = s.id WHERE s.organization_id = ?1",
     "SELECT count(*) FROM site WHERE organization_id = ?1"},
    "organization",
    "organizations"};

constexpr const char* k_write =
    "INSERT INTO site_quota (site_id, max_missions, max_measurements, max_anchors) VALUES (?1, ?2, ?3, ?4) "
    "ON CONFLICT (site_id) DO UPDATE SET max_missions = excluded.max_missions, max_measurements = "
    "excluded.max_measurements, max_anchors = excluded.max_anchors";
constexpr const char* k_write_organization =
    "INSERT INTO organization_quota (organization_id, max_missions, max_measurements, max_anchors, "
    "max_sites, requests_per_minute) VALUES (?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT (organization_id) DO UPDATE "
    "SET max_missions = excluded.max_missions, max_measurements = excluded.max_measurements, max_anchors = "
    "excluded.max_anchors, max_sites = excluded.max_sites, requests_per_minute = "
    "excluded.requests_per_minute";
constexpr const char* k_requests =
    "SELECT requests_per_minute FROM organization_quota WHERE organization_id = ?1";
constexpr const char* k_organization_of = "SELECT organization_id FROM site WHERE id = ?1";
constexpr const char* k_of_mission =
    "SELECT (SELECT CAST(coalesce(sum(n_ranges), 0) AS BIGINT) / 2 FROM device_seen WHERE mission_key = ?1) "
    "+ coalesce((SELECT n_fixes FROM mission_fixes WHERE mission_key = ?1), 0)";

constexpr const char* k_remedy[k_organization_quota_kinds] = {
    "remove flights permanently (those in the bin count)",
    "remove flights permanently (those in the bin count)", "move anchors to another site",
    "delete sites that are no longer used"};

template <std::size_t n, class I>
std::optional<QuotaLimits<n>> limits_of(Connection& c, const Owner<n>& owner, const I& id) {
  Query query(c, owner.limits);
  query << id;
  if (!query.step()) return std::nullopt;
  QuotaLimits<n> limits;
  for (auto& limit : limits) limit = query.maybe([&] { return query.as<std::uint64_t>(); });
  return limits;
}

template <std::size_t n, class I>
std::uint64_t count_used(Connection& c, const Owner<n>& owner, const I& id, std::size_t kind) {
  Query query(c, owner.used[kind]);
  query << id;
  return query.step() ? query.as<std::uint64_t>() : 0;
}

template <std::size_t n, class I>
Quota<n> quota_of(Connection& c, const Owner<n>& owner, const I& id) {
  Quota<n> quota;
  quota.limits = limits_of(c, owner, id).value_or(QuotaLimits<n>{});
  for (std::size_t i = 0; i < n; ++i) quota.used[i] = count_used(c, owner, id, i);
  return quota;
}

template <std::size_t n, class I>
Error refusal(Connection& c, const Owner<n>& owner, const I& id, std::size_t kind, std::uint64_t would_be,
              std::uint64_t limit) {
  Query query(c, owner.name);
  query << id;
  const std::string name = query.step() ? query.text() : "";
  const std::string what(k_quota_kind_words.word(static_cast<QuotaKind>(kind)));
  return make_error(Errc::conflict, "the quota of " + std::string(owner.word) + " \"" + name + "\" (" +
                                        to_string(id) + ") is " + std::to_string(limit) + " " + what +
                                        ", with this there would be " + std::to_string(would_be) + ": " +
                                        k_remedy[kind] + ", or have an administrator raise it (PUT /api/v1/" +
                                        std::string(owner.path) + "/" + to_string(id) + "/quota)");
}

/// counted: what comes is among what is used already.
template <std::size_t n, class I>
std::optional<Error> beyond(Connection& c, const Owner<n>& owner, const I& id, const QuotaCounts<n>& more,
                            bool counted) {
  const auto limits = limits_of(c, owner, id);
  if (!limits) return std::nullopt;
  for (std::size_t i = 0; i < n; ++i) {
    if (more[i] == 0 || !(*limits)[i]) continue;
    const auto would_be = count_used(c, owner, id, i) + (counted ? 0 : more[i]);
    if (would_be > *(*limits)[i]) return refusal(c, owner, id, i, would_be, *(*limits)[i]);
  }
  return std::nullopt;
}

std::optional<OrganizationId> organization_of(Connection& c, const std::optional<SiteId>& site) {
  if (!site) return std::nullopt;
  Query query(c, k_organization_of);
  query << *site;
  if (!query.step()) return std::nullopt;
  return query.maybe([&] { return query.id<OrganizationId>(); });
}

/// By the site's own quota, then by that of its organization, unless it comes from a site of the same.
std::optional<Error> beyond_either(Connection& c, const SiteId& site, const SiteCounts& more, bool counted,
                                   const std::optional<SiteId>& from) {
  if (auto error = beyond(c, k_quota_site, site, more, counted)) return error;
  const auto organization = organization_of(c, site);
  if (!organization || organization == organization_of(c, from)) return std::nullopt;
  return beyond(c, k_organization, *organization, {more[0], more[1], more[2], 0}, counted);
}

}  // namespace

SiteQuota read_quota(Connection& connection, const SiteId& site) {
  return quota_of(connection, k_quota_site, site);
}

OrganizationQuota read_quota(Connection& connection, const OrganizationId& organization) {
  return quota_of(connection, k_organization, organization);
}

OrganizationLimits read_limits(Connection& connection, const OrganizationId& organization) {
  OrganizationLimits out;
  if (const auto stored = limits_of(connection, k_organization, organization)) out.stored = *stored;
  Query query(connection, k_requests);
  query << organization;
  if (query.step()) out.requests_per_minute = query.maybe([&] { return query.as<std::uint32_t>(); });
  return out;
}

void write_limits(Connection& connection, const SiteId& site, const SiteLimits& limits) {
  Query query(connection, k_write);
  query << site;
  for (const auto& limit : limits) query << limit;
  query.run();
}

void write_limits(Connection& connection, const OrganizationId& organization,
                  const OrganizationLimits& limits) {
  Query query(connection, k_write_organization);
  query << organization;
  for (const auto& limit : limits.stored) query << limit;
  query << std::optional<std::uint64_t>(limits.requests_per_minute);
  query.run();
}

std::optional<Error> beyond_quota(Connection& connection, const std::optional<SiteId>& site,
                                  const SiteCounts& more, const std::optional<SiteId>& from) {
  if (!site) return std::nullopt;
  return beyond_either(connection, *site, more, false, from);
}

std::optional<Error> beyond_quota_now(Connection& connection, const SiteId& site, const SiteCounts& added) {
  return beyond_either(connection, site, added, true, std::nullopt);
}

std::optional<Error> beyond_quota(Connection& connection, const std::optional<OrganizationId>& organization,
                                  const SiteId& site) {
  if (!organization || !limits_of(connection, k_organization, *organization)) return std::nullopt;
  const SiteCounts brought = quota_of(connection, k_quota_site, site).used;
  return beyond(connection, k_organization, *organization, {brought[0], brought[1], brought[2], 1}, false);
}

std::uint64_t count_measurements(Connection& connection, std::int64_t mission_key) {
  Query query(connection, k_of_mission);
  query << mission_key;
  return query.step() ? query.as<std::uint64_t>() : 0;
}

}  // namespace anchord::sql
