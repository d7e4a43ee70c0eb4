#include "server/storage/measurement_rows.hpp"
#include "server/storage/site_quota.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

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

class SqlAnchorStore final : public AnchorStore {
 public:
  explicit SqlAnchorStore(Gate& gate) : gate_(gate) {}

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
      if (auto error = missing_site(c, anchor.site)) return error;
      if (const auto before = find_anchor(c, k_by_id, anchor.id); before && before->site != anchor.site)
        if (auto error = beyond_quota(c, anchor.site, {0, 0, 1}, before->site)) return error;
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

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<AnchorStore> make_anchor_store(Gate& gate) { return std::make_unique<SqlAnchorStore>(gate); }

}  // namespace anchord::sql
