#include "server/storage/calibration_rows.hpp"
#include "server/storage/measurement_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_site_insert =
    "INSERT INTO site (id, name, origin_lat_deg, origin_lon_deg, origin_height_m, outline_geojson, "
    "crs_frame, "
    "crs_epoch_year, base_sigma_m, base_source, projected_epsg, created_t_ns, version) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13) ON CONFLICT DO NOTHING RETURNING "
    "version";
constexpr const char* k_site_update =
    "UPDATE site SET name = ?2, origin_lat_deg = ?3, origin_lon_deg = ?4, origin_height_m = ?5, "
    "outline_geojson = ?6, "
    "crs_frame = ?7, crs_epoch_year = ?8, base_sigma_m = ?9, base_source = ?10, projected_epsg = ?11, "
    "created_t_ns = ?12, version = ?13 WHERE id = ?1 AND version = ?14 RETURNING version";
constexpr const char* k_site_columns =
    "SELECT id, name, origin_lat_deg, origin_lon_deg, origin_height_m, outline_geojson, crs_frame, "
    "crs_epoch_year, "
    "base_sigma_m, base_source, projected_epsg, created_t_ns, version FROM site ";
constexpr const char* k_site_users =
    "SELECT (SELECT count(*) FROM mission WHERE site_id = ?1) + (SELECT count(*) FROM anchor WHERE site_id = "
    "?1) + (SELECT count(*) FROM local_frame WHERE site_id = ?1)";
constexpr const char* k_site_remove = "DELETE FROM site WHERE id = ?1 AND version = ?2 RETURNING version";

constexpr const char* k_anchor_insert =
    "INSERT INTO anchor (id, network_id, site_id, name, building, floor, space, asset_tag, ifc_guid, "
    "retired, "
    "created_t_ns, version) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)";
constexpr const char* k_anchor_update =
    "UPDATE anchor SET network_id = ?2, site_id = ?3, name = ?4, building = ?5, floor = ?6, space = ?7, "
    "asset_tag = ?8, ifc_guid = ?9, retired = ?10, created_t_ns = ?11, version = ?12 "
    "WHERE id = ?1 AND version = ?13 RETURNING version";
constexpr const char* k_anchor_columns =
    "SELECT id, network_id, site_id, name, building, floor, space, asset_tag, ifc_guid, retired, "
    "created_t_ns, version "
    "FROM anchor ";
constexpr const char* k_external_ids =
    "SELECT system, external_id FROM anchor_external_id WHERE anchor_id = ?1 ORDER BY ordinal";
constexpr const char* k_drop_external_ids = "DELETE FROM anchor_external_id WHERE anchor_id = ?1";
constexpr const char* k_insert_external_id =
    "INSERT INTO anchor_external_id (anchor_id, ordinal, system, external_id) VALUES (?1, ?2, ?3, ?4)";

template <class AnyId>
Error absent(const char* what, const AnyId& id) {
  return make_error(Errc::not_found, std::string("no ") + what + " " + to_string(id));
}

void bind(Query& query, const Site& s, std::uint64_t version) {
  query << s.id << s.name;
  bind_wgs84(query, s.origin);
  query << s.outline_geojson << s.crs_frame << s.crs_epoch << s.base_sigma_m << s.base_source;
  if (s.projected_epsg)
    query << *s.projected_epsg;
  else
    query << std::nullopt;
  query << s.created << version;
}

Site read_site(Query& query) {
  Site s;
  s.id = query.id<SiteId>();
  s.name = query.text();
  s.origin = read_wgs84(query);
  s.outline_geojson = query.text();
  s.crs_frame = query.text();
  s.crs_epoch = query.maybe_real();
  s.base_sigma_m = query.maybe_real();
  s.base_source = query.text();
  s.projected_epsg = query.maybe([&] { return query.as<int>(); });
  s.created = query.time();
  s.version = query.as<std::uint64_t>();
  return s;
}

void bind(Query& query, const Anchor& a, std::uint64_t version) {
  query << a.id << a.network_id << a.site << a.name << a.building << a.floor << a.space << a.asset_tag
        << a.ifc_guid << a.retired << a.created << version;
}

void store_external_ids(Connection& c, const Anchor& anchor) {
  Query drop(c, k_drop_external_ids);
  drop << anchor.id;
  drop.run();
  Query insert(c, k_insert_external_id);
  std::int64_t ordinal = 0;
  for (const auto& [system, id] : anchor.external_ids) {
    insert.again();
    insert << anchor.id << ordinal++ << system << id;
    insert.run();
  }
}

Anchor read_anchor(Connection& c, Query& query) {
  Anchor a;
  a.id = query.id<AnchorId>();
  a.network_id = query.network_id();
  a.site = query.maybe([&] { return query.id<SiteId>(); });
  a.name = query.text();
  a.building = query.text();
  a.floor = query.text();
  a.space = query.text();
  a.asset_tag = query.text();
  a.ifc_guid = query.text();
  a.retired = query.integer() != 0;
  a.created = query.time();
  a.version = query.as<std::uint64_t>();
  Query external(c, k_external_ids);
  external << a.id;
  while (external.step()) {
    std::string system = external.text();
    a.external_ids.emplace_back(std::move(system), external.text());
  }
  return a;
}

template <class Key>
std::optional<Anchor> find_anchor(Connection& c, const char* where, const Key& key) {
  Query query(c, std::string(k_anchor_columns) + where);
  query << key;
  if (!query.step()) return std::nullopt;
  return read_anchor(c, query);
}
constexpr const char* k_by_id = "WHERE id = ?1";
constexpr const char* k_by_network_id = "WHERE network_id = ?1";

std::optional<Site> find_site(Connection& c, const SiteId& id) {
  Query query(c, std::string(k_site_columns) + k_by_id);
  query << id;
  if (!query.step()) return std::nullopt;
  return read_site(query);
}

Error moved_on(const char* what, std::uint64_t expected, std::uint64_t stored) {
  return make_error(Errc::conflict, std::string(what) + " is at version " + std::to_string(stored) +
                                        ", not " + std::to_string(expected));
}

class SqlAnchorStore final : public AnchorStore {
 public:
  explicit SqlAnchorStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Site& site) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_site_insert);
      bind(query, site, site.version);
      if (query.returned()) return std::nullopt;
      return make_error(Errc::conflict, "site " + to_string(site.id) + " exists");
    });
  }
  Result<void> update(const Site& site, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
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
  Result<std::vector<Site>> sites(std::size_t limit, const std::optional<SiteId>& after) override {
    return read_value<std::vector<Site>>(gate_, [&](Connection& c) -> Result<std::vector<Site>> {
      Query query(c, std::string(k_site_columns) + "WHERE id > ?1 ORDER BY id LIMIT ?2");
      const SiteId start = after.value_or(SiteId{});
      query << start << row_limit(limit);
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
        return make_error(Errc::conflict, "site " + to_string(id) +
                                              " has missions (deleted ones in the bin count) or anchors");
      }
      Query query(c, k_site_remove);
      query << id << expected_version;
      if (query.returned()) return std::nullopt;
      const auto stored = find_site(c, id);
      return stored ? moved_on("the site", expected_version, stored->version) : absent("site", id);
    });
  }

  Result<Anchor> find_or_create(NetworkId network_id, UtcTime now) override {
    auto found = anchor(network_id);
    if (found || found.error().code != Errc::not_found) return found;
    return write_value<Anchor>(gate_, 1, [&](Connection& c) -> Result<Anchor> {
      if (auto other = find_anchor(c, k_by_network_id, network_id))
        return *std::move(other);  // made meanwhile
      Anchor fresh;
      fresh.id = AnchorId{make_uuid_v7(now)};
      fresh.network_id = network_id;
      fresh.created = now;
      Query query(c, k_anchor_insert);
      bind(query, fresh, fresh.version);
      query.run();
      return fresh;
    });
  }
  Result<void> update(const Anchor& anchor, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (anchor.site && !find_site(c, *anchor.site)) return absent("site", *anchor.site);
      Query query(c, k_anchor_update);
      bind(query, anchor, expected_version + 1);
      query << expected_version;
      if (!query.returned()) {
        const auto stored = find_anchor(c, k_by_id, anchor.id);
        return stored ? moved_on("the anchor", expected_version, stored->version)
                      : absent("anchor", anchor.id);
      }
      store_external_ids(c, anchor);
      return std::nullopt;
    });
  }
  Result<Anchor> anchor(const AnchorId& id) override {
    return read_value<Anchor>(gate_, [&](Connection& c) -> Result<Anchor> {
      auto found = find_anchor(c, k_by_id, id);
      if (!found) return absent("anchor", id);
      return *std::move(found);
    });
  }
  Result<Anchor> anchor(NetworkId network_id) override {
    return read_value<Anchor>(gate_, [&](Connection& c) -> Result<Anchor> {
      auto found = find_anchor(c, k_by_network_id, network_id);
      if (!found) return absent("anchor", network_id);
      return *std::move(found);
    });
  }
  Result<std::vector<Anchor>> anchors(std::size_t limit, const std::optional<AnchorId>& after) override {
    return read_value<std::vector<Anchor>>(gate_, [&](Connection& c) -> Result<std::vector<Anchor>> {
      Query query(c, std::string(k_anchor_columns) + "WHERE id > ?1 ORDER BY id LIMIT ?2");
      const AnchorId start = after.value_or(AnchorId{});
      query << start << row_limit(limit);
      std::vector<Anchor> found;
      while (query.step()) found.push_back(read_anchor(c, query));
      return found;
    });
  }

  Result<void> insert(const Calibration& calibration) override {
    return write_void(gate_, [&](Connection& c) { return insert_calibration(c, calibration); });
  }
  Result<Calibration> calibration(const CalibrationId& id) override {
    return read_value<Calibration>(gate_, [&](Connection& c) { return find_calibration(c, id); });
  }
  Result<std::vector<Calibration>> calibrations(std::size_t limit,
                                                const std::optional<CalibrationId>& after) override {
    return read_value<std::vector<Calibration>>(
        gate_, [&](Connection& c) { return list_calibrations(c, row_limit(limit), after); });
  }
  Result<std::string> evidence(const CalibrationId& id) override {
    return read_value<std::string>(gate_, [&](Connection& c) { return find_evidence(c, id); });
  }
  Result<void> remove(const CalibrationId& id) override {
    return write_void(gate_, [&](Connection& c) { return remove_calibration(c, id); });
  }
  Result<Revision> publish(const CalibrationId& id, const std::vector<NetworkId>& anchors,
                           std::string_view by, std::string_view note, UtcTime now,
                           const std::vector<Override>& overrides,
                           std::optional<std::uint64_t> judged_on) override {
    return write_value<Revision>(gate_, 1, [&](Connection& c) {
      return publish_revision(c, id, anchors, by, note, now, overrides, judged_on);
    });
  }
  Result<std::vector<Revision>> revisions(std::size_t limit, std::uint64_t before) override {
    return read_value<std::vector<Revision>>(
        gate_, [&](Connection& c) { return list_revisions(c, row_limit(limit), before); });
  }
  Result<std::vector<PublishedPosition>> published(std::optional<std::uint64_t> revision) override {
    return read_value<std::vector<PublishedPosition>>(
        gate_, [&](Connection& c) { return positions_of_revision(c, revision); });
  }
  Result<std::vector<PublishedPosition>> history(NetworkId network_id) override {
    return read_value<std::vector<PublishedPosition>>(
        gate_, [&](Connection& c) { return positions_of_anchor(c, network_id); });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<AnchorStore> make_anchor_store(Gate& gate) { return std::make_unique<SqlAnchorStore>(gate); }

}  // namespace anchord::sql
