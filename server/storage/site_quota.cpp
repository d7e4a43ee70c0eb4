#include "server/storage/site_quota.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_limits =
    "SELECT max_missions, max_measurements, max_anchors FROM site_quota WHERE site_id = ?1";
constexpr const char* k_write =
    "INSERT INTO site_quota (site_id, max_missions, max_measurements, max_anchors) VALUES (?1, ?2, ?3, ?4) "
    "ON CONFLICT (site_id) DO UPDATE SET max_missions = excluded.max_missions, max_measurements = "
    "excluded.max_measurements, max_anchors = excluded.max_anchors";
// By what the appends counted, as in measurement_store.cpp.
constexpr const char* k_used[k_quota_kinds] = {
    "SELECT count(*) FROM mission WHERE site_id = ?1",
    "SELECT (SELECT CAST(coalesce(sum(d.n_ranges), 0) AS BIGINT) / 2 FROM mission m JOIN device_seen d ON "
    "d.mission_key = m.mission_key WHERE m.site_id = ?1) + (SELECT CAST(coalesce(sum(k.n_fixes), 0) AS "
    "BIGINT) FROM mission m JOIN mission_fixes k ON k.mission_key = m.mission_key WHERE m.site_id = ?1)",
    "SELECT count(*) FROM anchor WHERE site_id = ?1"};
constexpr const char* k_of_mission =
    "SELECT (SELECT CAST(coalesce(sum(n_ranges), 0) AS BIGINT) / 2 FROM device_seen WHERE mission_key = ?1) "
    "+ coalesce((SELECT n_fixes FROM mission_fixes WHERE mission_key = ?1), 0)";
constexpr const char* k_name = "SELECT name FROM site WHERE id = ?1";

constexpr const char* k_remedy[k_quota_kinds] = {"remove flights permanently (those in the bin count)",
                                                 "remove flights permanently (those in the bin count)",
                                                 "move anchors to another site"};

std::optional<SiteLimits> read_limits(Connection& c, const SiteId& site) {
  Query query(c, k_limits);
  query << site;
  if (!query.step()) return std::nullopt;
  SiteLimits limits;
  for (auto& limit : limits) limit = query.maybe([&] { return query.as<std::uint64_t>(); });
  return limits;
}

std::uint64_t count_used(Connection& c, const SiteId& site, std::size_t kind) {
  Query query(c, k_used[kind]);
  query << site;
  return query.step() ? query.as<std::uint64_t>() : 0;
}

Error refusal(Connection& c, const SiteId& site, std::size_t kind, std::uint64_t would_be,
              std::uint64_t limit) {
  Query query(c, k_name);
  query << site;
  const std::string name = query.step() ? query.text() : "";
  const std::string what(k_quota_kind_words.word(static_cast<QuotaKind>(kind)));
  return make_error(Errc::conflict, "the quota of site \"" + name + "\" (" + to_string(site) + ") is " +
                                        std::to_string(limit) + " " + what + ", with this there would be " +
                                        std::to_string(would_be) + ": " + k_remedy[kind] +
                                        ", or have an administrator raise it (PUT /api/v1/sites/" +
                                        to_string(site) + "/quota)");
}

}  // namespace

SiteQuota read_quota(Connection& connection, const SiteId& site) {
  SiteQuota quota;
  quota.limits = read_limits(connection, site).value_or(SiteLimits{});
  for (std::size_t i = 0; i < k_quota_kinds; ++i) quota.used[i] = count_used(connection, site, i);
  return quota;
}

void write_limits(Connection& connection, const SiteId& site, const SiteLimits& limits) {
  Query query(connection, k_write);
  query << site;
  for (const auto& limit : limits) query << limit;
  query.run();
}

std::optional<Error> beyond_quota(Connection& connection, const std::optional<SiteId>& site,
                                  const SiteCounts& more) {
  if (!site) return std::nullopt;
  const auto limits = read_limits(connection, *site);
  if (!limits) return std::nullopt;
  for (std::size_t i = 0; i < k_quota_kinds; ++i) {
    if (more[i] == 0 || !(*limits)[i]) continue;
    const auto would_be = count_used(connection, *site, i) + more[i];
    if (would_be > *(*limits)[i]) return refusal(connection, *site, i, would_be, *(*limits)[i]);
  }
  return std::nullopt;
}

std::optional<Error> beyond_quota_now(Connection& connection, const SiteId& site, const SiteCounts& added) {
  const auto limits = read_limits(connection, site);
  if (!limits) return std::nullopt;
  for (std::size_t i = 0; i < k_quota_kinds; ++i) {
    if (added[i] == 0 || !(*limits)[i]) continue;
    const auto used = count_used(connection, site, i);
    if (used > *(*limits)[i]) return refusal(connection, site, i, used, *(*limits)[i]);
  }
  return std::nullopt;
}

std::uint64_t count_measurements(Connection& connection, std::int64_t mission_key) {
  Query query(connection, k_of_mission);
  query << mission_key;
  return query.step() ? query.as<std::uint64_t>() : 0;
}

}  // namespace anchord::sql
