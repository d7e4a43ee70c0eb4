#include <array>

#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr std::size_t k_part_bytes = std::size_t{1} << 20;

constexpr const char* k_building_insert =
    "INSERT INTO building (id, site_id, name, height_m, created_t_ns, version) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6)";
constexpr const char* k_building_update =
    "UPDATE building SET site_id = ?2, name = ?3, height_m = ?4, created_t_ns = ?5, version = ?6 "
    "WHERE id = ?1 AND version = ?7 RETURNING version";
constexpr const char* k_building_columns =
    "SELECT id, site_id, name, height_m, created_t_ns, version FROM building ";
constexpr const char* k_building_floors = "SELECT count(*) FROM building_floor WHERE building_id = ?1";
constexpr const char* k_building_remove =
    "DELETE FROM building WHERE id = ?1 AND version = ?2 RETURNING version";

constexpr const char* k_floor_insert =
    "INSERT INTO building_floor (id, building_id, name, level, base_height_m, georeference, proposal, "
    "structure, created_t_ns, version) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)";
constexpr const char* k_floor_update =
    "UPDATE building_floor SET building_id = ?2, name = ?3, level = ?4, base_height_m = ?5, georeference = "
    "?6, proposal = ?7, structure = ?8, created_t_ns = ?9, version = ?10 WHERE id = ?1 AND version = ?11 "
    "RETURNING version";
constexpr const char* k_floor_columns =
    "SELECT id, building_id, name, level, base_height_m, georeference, proposal, structure, created_t_ns, "
    "version FROM building_floor ";
constexpr const char* k_floor_remove =
    "DELETE FROM building_floor WHERE id = ?1 AND version = ?2 RETURNING version";

constexpr const char* k_images =
    "SELECT id, kind, media_type, width_px, height_px, bytes, sha256 FROM plan_image "
    "WHERE floor_id = ?1 AND named = 1";
constexpr const char* k_image_insert =
    "INSERT INTO plan_image (id, floor_id, kind, named, media_type, width_px, height_px, bytes, sha256) "
    "VALUES (?1, ?2, ?3, 0, ?4, ?5, ?6, ?7, ?8)";
constexpr const char* k_image_name =
    "UPDATE plan_image SET named = 1 WHERE id = ?1 AND floor_id = ?2 RETURNING image_key";
constexpr const char* k_images_forget =
    "DELETE FROM plan_image WHERE floor_id = ?1 AND id NOT IN (?2, ?3, ?4)";
constexpr const char* k_part_insert =
    "INSERT INTO plan_image_part (image_id, ordinal, content) SELECT id, ?2, ?3 FROM plan_image WHERE id = "
    "?1 "
    "RETURNING ordinal";
constexpr const char* k_place_part =
    "SELECT content FROM plan_image_part WHERE image_id = ?1 AND ordinal = ?2";
constexpr const char* k_image_size = "SELECT bytes FROM plan_image WHERE id = ?1";

/// Rows and bytes of tiles that one transaction writes, and rows that one deletes.
constexpr std::size_t k_tile_rows = 256, k_tile_bytes = std::size_t{1} << 20;
constexpr int k_tiles_deleted = 16;

constexpr const char* k_tiles =
    "SELECT id, n_levels, m_per_px, width_px, height_px, west_m, north_m, bytes, sha256 FROM plan_tiles "
    "WHERE floor_id = ?1 AND named = 1";
constexpr const char* k_tiles_insert =
    "INSERT INTO plan_tiles (id, floor_id, named, n_levels, m_per_px, width_px, height_px, west_m, north_m, "
    "bytes, sha256) VALUES (?1, ?2, 0, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)";
/// Changes nothing, and holds the row until the transaction ends.
constexpr const char* k_tiles_hold =
    "UPDATE plan_tiles SET named = named WHERE id = ?1 AND floor_id = ?2 RETURNING tiles_key";
constexpr const char* k_tiles_name =
    "UPDATE plan_tiles SET named = 1 WHERE id = ?1 AND floor_id = ?2 RETURNING tiles_key";
constexpr const char* k_tiles_forget =
    "UPDATE plan_tiles SET floor_id = NULL WHERE floor_id = ?1 AND id <> ?2";
constexpr const char* k_tiles_of_nobody = "SELECT id FROM plan_tiles WHERE floor_id IS NULL LIMIT 1";
constexpr const char* k_tiles_empty =
    "DELETE FROM plan_tile WHERE tile_key IN (SELECT tile_key FROM plan_tile WHERE tiles_id = ?1 LIMIT ?2) "
    "RETURNING tile_key";
constexpr const char* k_tiles_delete = "DELETE FROM plan_tiles WHERE id = ?1";
constexpr const char* k_tile =
    "SELECT content FROM plan_tile WHERE tiles_id = ?1 AND level = ?2 AND tile_column = ?3 AND tile_row = ?4";

Building read_building(Query& query) {
  Building b;
  b.id = query.id<BuildingId>();
  b.site = query.id<SiteId>();
  b.name = query.text();
  b.height_m = query.maybe_real();
  b.created = query.time();
  b.version = query.as<std::uint64_t>();
  return b;
}

std::optional<Building> find_building(Connection& c, const BuildingId& id) {
  Query query(c, std::string(k_building_columns) + "WHERE id = ?1");
  query << id;
  if (!query.step()) return std::nullopt;
  return read_building(query);
}

Floor read_floor(Connection& c, Query& query) {
  Floor f;
  f.id = query.id<FloorId>();
  f.building = query.id<BuildingId>();
  f.name = query.text();
  f.level = query.real();
  f.base_height_m = query.maybe_real();
  f.georeference = query.document();
  f.proposal = query.document();
  f.structure = query.document();
  f.created = query.time();
  f.version = query.as<std::uint64_t>();
  Query images(c, k_images);
  images << f.id;
  while (images.step()) {
    StoredImage image;
    image.id = images.id<ImageId>();
    image.kind = images.one_of(k_image_kind_words);
    image.media_type = images.text();
    image.width_px = images.integer();
    image.height_px = images.integer();
    image.bytes = images.integer();
    image.sha256_hex = images.text();
    auto& to = image.kind == ImageKind::plan      ? f.plan
               : image.kind == ImageKind::preview ? f.preview
                                                  : f.backdrop;
    to = std::move(image);
  }
  Query tiles(c, k_tiles);
  tiles << f.id;
  if (tiles.step()) {
    auto& t = f.tiles.emplace();
    t.id = tiles.id<PlanTilesId>();
    t.n_levels = tiles.as<int>();
    t.m_per_px = tiles.real();
    t.width_px = tiles.integer();
    t.height_px = tiles.integer();
    t.west_m = tiles.real();
    t.north_m = tiles.real();
    t.bytes = tiles.integer();
    t.sha256_hex = tiles.text();
  }
  return f;
}

std::optional<Floor> find_floor(Connection& c, const FloorId& id) {
  Query query(c, std::string(k_floor_columns) + "WHERE id = ?1");
  query << id;
  if (!query.step()) return std::nullopt;
  return read_floor(c, query);
}

void bind(Query& query, const Floor& f, std::uint64_t version) {
  query << f.id << f.building << f.name << f.level << f.base_height_m << f.georeference << f.proposal
        << f.structure << f.created << version;
}

class SqlPlaceStore final : public PlaceStore {
 public:
  explicit SqlPlaceStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Building& b) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = missing_site(c, b.site)) return error;
      Query query(c, k_building_insert);
      query << b.id << b.site << b.name << b.height_m << b.created << b.version;
      query.run();
      return std::nullopt;
    });
  }
  Result<void> update(const Building& b, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = missing_site(c, b.site)) return error;
      Query query(c, k_building_update);
      query << b.id << b.site << b.name << b.height_m << b.created << expected_version + 1
            << expected_version;
      if (query.returned()) return std::nullopt;
      return stale(c, b.id, expected_version);
    });
  }
  Result<Building> building(const BuildingId& id) override {
    return read_value<Building>(gate_, [&](Connection& c) -> Result<Building> {
      auto found = find_building(c, id);
      if (!found) return absent("building", id);
      return *std::move(found);
    });
  }
  Result<std::vector<Building>> buildings(std::size_t limit, const std::optional<BuildingId>& after,
                                          const std::optional<SiteId>& site) override {
    return read_value<std::vector<Building>>(gate_, [&](Connection& c) -> Result<std::vector<Building>> {
      Query query(c, std::string(k_building_columns) +
                         "WHERE id > ?1 AND (?3 IS NULL OR site_id = ?3) ORDER BY id LIMIT ?2");
      const BuildingId start = after.value_or(BuildingId{});
      query << start << row_limit(limit) << site;
      std::vector<Building> found;
      while (query.step()) found.push_back(read_building(query));
      return found;
    });
  }
  Result<void> remove(const BuildingId& id, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query floors(c, k_building_floors);
      floors << id;
      const auto n = floors.step() ? floors.integer() : 0;
      if (n > 0)
        return make_error(Errc::conflict,
                          "the building has " + std::to_string(n) +
                              (n == 1 ? " floor: delete it first" : " floors: delete them first"));
      Query query(c, k_building_remove);
      query << id << expected_version;
      if (query.returned()) return std::nullopt;
      return stale(c, id, expected_version);
    });
  }

  Result<void> insert(const Floor& f) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (!find_building(c, f.building)) return absent("building", f.building);
      Query query(c, k_floor_insert);
      bind(query, f, f.version);
      query.run();
      return std::nullopt;
    });
  }
  Result<void> update(const Floor& f, std::uint64_t expected_version) override {
    BOOST_OUTCOME_TRYV(write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (!find_building(c, f.building)) return absent("building", f.building);
      Query query(c, k_floor_update);
      bind(query, f, expected_version + 1);
      query << expected_version;
      if (!query.returned()) return stale(c, f.id, expected_version);
      std::array<ImageId, 3> named{};  // outlives the statement it is bound to
      std::size_t n = 0;
      for (const auto* image : {&f.plan, &f.preview, &f.backdrop}) {
        if (!*image) continue;
        named[n] = (*image)->id;
        Query name(c, k_image_name);
        name << named[n] << f.id;
        if (!name.returned()) return absent("picture", named[n]);
        ++n;
      }
      Query forget(c, k_images_forget);
      forget << f.id << named[0] << named[1] << named[2];
      forget.run();
      return change_tiles(c, f);
    }));
    delete_tiles_of_nobody();
    return boost::outcome_v2::success();
  }
  Result<Floor> floor(const FloorId& id) override {
    return read_value<Floor>(gate_, [&](Connection& c) -> Result<Floor> {
      auto found = find_floor(c, id);
      if (!found) return absent("floor", id);
      return *std::move(found);
    });
  }
  Result<std::vector<Floor>> floors(std::size_t limit, const std::optional<FloorId>& after,
                                    const std::optional<BuildingId>& building) override {
    return read_value<std::vector<Floor>>(gate_, [&](Connection& c) -> Result<std::vector<Floor>> {
      Query query(c, std::string(k_floor_columns) +
                         "WHERE id > ?1 AND (?3 IS NULL OR building_id = ?3) ORDER BY id LIMIT ?2");
      const FloorId start = after.value_or(FloorId{});
      query << start << row_limit(limit) << building;
      std::vector<Floor> found;
      while (query.step()) found.push_back(read_floor(c, query));
      return found;
    });
  }
  Result<void> remove(const FloorId& id, std::uint64_t expected_version) override {
    BOOST_OUTCOME_TRYV(write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_floor_remove);
      query << id << expected_version;
      if (query.returned()) return std::nullopt;
      return stale(c, id, expected_version);
    }));
    delete_tiles_of_nobody();
    return boost::outcome_v2::success();
  }

  Result<void> keep(const FloorId& floor, const StoredImage& image, std::string_view bytes) override {
    BOOST_OUTCOME_TRYV(write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (!find_floor(c, floor)) return absent("floor", floor);
      Query query(c, k_image_insert);
      query << image.id << floor << static_cast<std::uint8_t>(image.kind) << image.media_type
            << image.width_px << image.height_px << static_cast<std::int64_t>(bytes.size())
            << image.sha256_hex;
      query.run();
      return std::nullopt;
    }));
    std::int64_t ordinal = 0;
    for (std::size_t at = 0; at < bytes.size(); at += k_part_bytes, ++ordinal) {
      const auto part = bytes.substr(at, k_part_bytes);
      BOOST_OUTCOME_TRYV(write_void(gate_, [&](Connection& c) -> std::optional<Error> {
        Query query(c, k_part_insert);
        query << image.id << ordinal << std::as_bytes(std::span(part));
        if (query.returned()) return std::nullopt;
        return changed_meanwhile();
      }));
    }
    return boost::outcome_v2::success();
  }
  Result<void> keep(const FloorId& floor, const PlanTiles& tiles,
                    std::span<const PlanTile> pictures) override {
    BOOST_OUTCOME_TRYV(write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (!find_floor(c, floor)) return absent("floor", floor);
      Query query(c, k_tiles_insert);
      query << tiles.id << floor << tiles.n_levels << tiles.m_per_px << tiles.width_px << tiles.height_px
            << tiles.west_m << tiles.north_m << tiles.bytes << tiles.sha256_hex;
      query.run();
      return std::nullopt;
    }));
    for (std::size_t at = 0; at < pictures.size();) {
      std::size_t n = 0;
      for (std::size_t bytes = 0; at + n < pictures.size() && n < k_tile_rows && bytes < k_tile_bytes; ++n)
        bytes += pictures[at + n].png.size();
      const auto some = pictures.subspan(at, n);
      BOOST_OUTCOME_TRYV(write_void(gate_, [&](Connection& c) -> std::optional<Error> {
        Query hold(c, k_tiles_hold);
        hold << tiles.id << floor;
        if (!hold.returned()) return changed_meanwhile();
        (void)c.insert_rows({"plan_tile", "tiles_id, level, tile_column, tile_row, content"}, some.size(),
                            [&](Query& query, std::size_t row) {
                              const auto& tile = some[row];
                              query << tiles.id << tile.level << tile.column << tile.row
                                    << std::as_bytes(std::span(tile.png));
                            });
        return std::nullopt;
      }));
      at += n;
    }
    return boost::outcome_v2::success();
  }
  Result<std::optional<std::string>> tile(const PlanTilesId& tiles, int level, int column, int row) override {
    return read_value<std::optional<std::string>>(
        gate_, [&](Connection& c) -> Result<std::optional<std::string>> {
          Query query(c, k_tile);
          query << tiles << level << column << row;
          if (!query.step()) return std::optional<std::string>();
          const auto png = query.blob();
          return std::optional<std::string>(std::in_place, reinterpret_cast<const char*>(png.data()),
                                            png.size());
        });
  }
  Result<std::string> bytes(const ImageId& image) override {
    return read_value<std::string>(gate_, [&](Connection& c) -> Result<std::string> {
      Query size(c, k_image_size);
      size << image;
      if (!size.step()) return absent("picture", image);
      std::string out;
      out.reserve(static_cast<std::size_t>(size.integer()));
      Query query(c, k_place_part);
      for (std::int64_t ordinal = 0;; ++ordinal) {
        query.again();
        query << image << ordinal;
        if (!query.step()) break;
        const auto part = query.blob();
        out.append(reinterpret_cast<const char*>(part.data()), part.size());
      }
      return out;
    });
  }

 private:
  static Error changed_meanwhile() {
    return make_error(Errc::conflict, "the floor was changed while its plan was being sent: send it again");
  }
  static std::optional<Error> change_tiles(Connection& c, const Floor& f) {
    const PlanTilesId named = f.tiles ? f.tiles->id : PlanTilesId{};
    if (f.tiles) {
      Query name(c, k_tiles_name);
      name << named << f.id;
      if (!name.returned()) return absent("tiles", named);
    }
    Query forget(c, k_tiles_forget);
    forget << f.id << named;
    forget.run();
    return std::nullopt;
  }
  /// In parts, so that measurements are committed between them. What a fault leaves goes with the next change
  /// of any floor: the change that was asked for is done, and no reason to refuse it.
  void delete_tiles_of_nobody() {
    bool more = true;
    while (more) {
      const auto deleted = write_void(gate_, [&](Connection& c) -> std::optional<Error> {
        Query nobody(c, k_tiles_of_nobody);
        more = nobody.step();
        if (!more) return std::nullopt;
        const auto id = nobody.id<PlanTilesId>();
        Query some(c, k_tiles_empty);
        some << id << k_tiles_deleted;
        int n = 0;
        while (some.step()) ++n;
        if (n == k_tiles_deleted) return std::nullopt;
        Query whole(c, k_tiles_delete);
        whole << id;
        whole.run();
        return std::nullopt;
      });
      if (!deleted) return;
    }
  }
  static Error stale(Connection& c, const BuildingId& id, std::uint64_t expected_version) {
    const auto stored = find_building(c, id);
    return stored ? moved_on("the building", expected_version, stored->version) : absent("building", id);
  }
  static Error stale(Connection& c, const FloorId& id, std::uint64_t expected_version) {
    const auto stored = find_floor(c, id);
    return stored ? moved_on("the floor", expected_version, stored->version) : absent("floor", id);
  }
  Gate& gate_;
};

}  // namespace

std::unique_ptr<PlaceStore> make_place_store(Gate& gate) { return std::make_unique<SqlPlaceStore>(gate); }

}  // namespace anchord::sql
