#include "server/storage/measurement_rows.hpp"
#include "server/storage/outline_text.hpp"
#include "server/storage/site_quota.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_site_insert =
    "INSERT INTO site (id, name, origin_lat_deg, origin_lon_deg, origin_height_m, outline_geojson, "
    "crs_frame, "
    "crs_epoch_year, base_sigma_m, base_source, projected_epsg, created_t_ns, organization_id, version) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14) ON CONFLICT DO NOTHING RETURNING "
    "version";
constexpr const char* k_site_update =
    "UPDATE site SET name = ?2, origin_lat_deg = ?3, origin_lon_deg = ?4, origin_height_m = ?5, "
    "outline_geojson = ?6, "
    "crs_frame = ?7, crs_epoch_year = ?8, base_sigma_m = ?9, base_source = ?10, projected_epsg = ?11, "
    "created_t_ns = ?12, organization_id = ?13, version = ?14 WHERE id = ?1 AND version = ?15 RETURNING "
    "version";
constexpr const char* k_site_columns =
    "SELECT id, name, origin_lat_deg, origin_lon_deg, origin_height_m, outline_geojson, crs_frame, "
    "crs_epoch_year, "
    "base_sigma_m, base_source, projected_epsg, created_t_ns, organization_id, version FROM site ";
constexpr const char* k_site_users =
    "SELECT (SELECT count(*) FROM mission WHERE site_id = ?1) + (SELECT count(*) FROM anchor WHERE site_id = "
    "?1) + (SELECT count(*) FROM local_frame WHERE site_id = ?1) + (SELECT count(*) FROM building WHERE "
    "site_id = ?1)";
constexpr const char* k_site_remove = "DELETE FROM site WHERE id = ?1 AND version = ?2 RETURNING version";

void bind(Query& query, const Site& s, std::uint64_t version) {
  query << s.id << s.name;
  bind_wgs84(query, s.origin);
  query << outline_text(s.outline) << s.crs_frame << s.crs_epoch << s.base_sigma_m << s.base_source;
  if (s.projected_epsg)
    query << *s.projected_epsg;
  else
    query << std::nullopt;
  query << s.created << s.organization << version;
}

Site read_site(Query& query) {
  Site s;
  s.id = query.id<SiteId>();
  s.name = query.text();
  s.origin = read_wgs84(query);
  s.outline = outline_in(query.text());
  s.crs_frame = query.text();
  s.crs_epoch = query.maybe_real();
  s.base_sigma_m = query.maybe_real();
  s.base_source = query.text();
  s.projected_epsg = query.maybe([&] { return query.as<int>(); });
  s.created = query.time();
  s.organization = query.maybe([&] { return query.id<OrganizationId>(); });
  s.version = query.as<std::uint64_t>();
  return s;
}

std::optional<Site> find_site(Connection& c, const SiteId& id) {
  Query query(c, std::string(k_site_columns) + "WHERE id = ?1");
  query << id;
  if (!query.step()) return std::nullopt;
  return read_site(query);
}

/// Why it may not become one of its organization.
std::optional<Error> comes_into(Connection& c, const Site& site) {
  if (auto missing = missing_organization(c, site.organization)) return missing;
  return beyond_quota(c, site.organization, site.id);
}

class SqlSiteStore final : public SiteStore {
 public:
  explicit SqlSiteStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Site& site) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = comes_into(c, site)) return error;
      Query query(c, k_site_insert);
      bind(query, site, site.version);
      if (query.returned()) return std::nullopt;
      return make_error(Errc::conflict, "site " + to_string(site.id) + " exists");
    });
  }
  Result<void> update(const Site& site, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      const auto before = find_site(c, site.id);
      if (before && before->organization != site.organization)
        if (auto error = comes_into(c, site)) return error;
      Query query(c, k_site_update);
      bind(query, site, expected_version + 1);
      query << expected_version;
      if (query.returned()) return std::nullopt;
      const auto stored = find_site(c, site.id);
      return stored ? moved_on("the site", expected_version, stored->version) : absent("site", site.id);
    });
  }
  Result<Site> site(const SiteId& id) override {
    return read_value<Site>(gate_, [&](Connection& c) -> Result<Site> {
      auto found = find_site(c, id);
      if (!found) return absent("site", id);
      return *std::move(found);
    });
  }
  Result<std::vector<Site>> sites(std::size_t limit, const std::optional<SiteId>& after,
                                  const std::optional<OrganizationId>& organization) override {
    return read_value<std::vector<Site>>(gate_, [&](Connection& c) -> Result<std::vector<Site>> {
      const char* const of = organization ? "AND organization_id = ?3 " : "";
      Query query(c, std::string(k_site_columns) + "WHERE id > ?1 " + of + "ORDER BY id LIMIT ?2");
      const SiteId start = after.value_or(SiteId{});
      query << start << row_limit(limit);
      if (organization) query << *organization;
      std::vector<Site> found;
      while (query.step()) found.push_back(read_site(query));
      return found;
    });
  }
  Result<void> remove(const SiteId& id, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query users(c, k_site_users);
      users << id;
      if (users.step() && users.integer() > 0) {
        return make_error(Errc::conflict,
                          "site " + to_string(id) +
                              " has missions (deleted ones in the bin count), anchors, frames or "
                              "buildings");
      }
      Query query(c, k_site_remove);
      query << id << expected_version;
      if (query.returned()) return std::nullopt;
      const auto stored = find_site(c, id);
      return stored ? moved_on("the site", expected_version, stored->version) : absent("site", id);
    });
  }

  Result<SiteQuota> quota(const SiteId& id) override {
    return read_value<SiteQuota>(gate_, [&](Connection& c) -> Result<SiteQuota> {
      if (auto missing = missing_site(c, id)) return *std::move(missing);
      return read_quota(c, id);
    });
  }
  Result<void> set_limits(const SiteId& id, const SiteLimits& limits) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto missing = missing_site(c, id)) return missing;
      write_limits(c, id, limits);
      return std::nullopt;
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::optional<Error> missing_site(Connection& connection, const std::optional<SiteId>& site) {
  if (!site || find_site(connection, *site)) return std::nullopt;
  return absent("site", *site);
}

std::unique_ptr<SiteStore> make_site_store(Gate& gate) { return std::make_unique<SqlSiteStore>(gate); }

}  // namespace anchord::sql
