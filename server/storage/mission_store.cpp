#include <algorithm>
#include <limits>

#include "server/storage/site_quota.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

// What is in the bin exists for the bin alone (mission_bin_store.cpp).
constexpr const char* k_not_binned = "mission_key NOT IN (SELECT mission_key FROM mission_bin)";
constexpr const char* k_mission_key =
    "SELECT mission_key FROM mission WHERE id = ?1 AND mission_key NOT IN (SELECT mission_key FROM "
    "mission_bin)";
constexpr const char* k_id_taken = "SELECT count(*) FROM mission WHERE id = ?1";
constexpr const char* k_mission_insert =
    "INSERT INTO mission (id, site_id, name, kit, radio, frame, track_point, state, created_t_ns, "
    "finished_t_ns, lever_arm_sigma_m) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11) RETURNING mission_key";
constexpr const char* k_mission_update =
    "UPDATE mission SET site_id = ?2, name = ?3, kit = ?4, radio = ?5, frame = ?6, track_point = ?7, state = "
    "?8, "
    "created_t_ns = ?9, finished_t_ns = ?10, lever_arm_sigma_m = ?11 WHERE id = ?1 RETURNING mission_key";
constexpr const char* k_mission_finish =
    "UPDATE mission SET state = ?3, finished_t_ns = ?2 WHERE id = ?1 AND state <> ?3 RETURNING mission_key";
constexpr const char* k_mission_columns =
    "SELECT mission_key, id, site_id, name, kit, radio, frame, track_point, state, created_t_ns, "
    "finished_t_ns, lever_arm_sigma_m "
    "FROM mission ";
constexpr const char* k_insert_tag =
    "INSERT INTO mission_tag (mission_key, ordinal, tag, antenna, lever_arm_forward_m, lever_arm_left_m, "
    "lever_arm_up_m) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)";
constexpr const char* k_tags =
    "SELECT tag, antenna, lever_arm_forward_m, lever_arm_left_m, lever_arm_up_m FROM mission_tag "
    "WHERE mission_key = ?1 ORDER BY ordinal";
constexpr const char* k_drop_tags = "DELETE FROM mission_tag WHERE mission_key = ?1";
/// Counted anew only while rows go; else what the appends kept.
constexpr const char* k_binned =
    "SELECT b.deleted_t_ns, b.deleted_ran_ns, b.deleted_by, b.emptying, "
    "CASE WHEN b.emptying = 1 THEN (SELECT count(*) FROM uwb_range r WHERE r.mission_key = b.mission_key) "
    "ELSE (SELECT CAST(coalesce(sum(d.n_ranges), 0) AS BIGINT) / 2 FROM device_seen d WHERE d.mission_key = "
    "b.mission_key) END, "
    "CASE WHEN b.emptying = 1 THEN (SELECT count(*) FROM fix f WHERE f.mission_key = b.mission_key) "
    "ELSE coalesce((SELECT k.n_fixes FROM mission_fixes k WHERE k.mission_key = b.mission_key), 0) END, m.id "
    "FROM mission_bin b JOIN mission m ON m.mission_key = b.mission_key ORDER BY b.deleted_ran_ns DESC, "
    "b.mission_key DESC";
constexpr const char* k_site = "SELECT 1 FROM site WHERE id = ?1";
constexpr const char* k_site_of = "SELECT site_id FROM mission WHERE mission_key = ?1";

Error no_mission(const MissionId& id) { return make_error(Errc::not_found, "no mission " + to_string(id)); }

std::optional<Error> check_site(Connection& connection, const Mission& mission) {
  if (!mission.site) return std::nullopt;
  Query query(connection, k_site);
  query << *mission.site;
  if (query.step()) return std::nullopt;
  return make_error(Errc::not_found, "no site " + to_string(*mission.site));
}

std::optional<SiteId> site_of(Connection& connection, std::int64_t key) {
  Query query(connection, k_site_of);
  query << key;
  if (!query.step()) return std::nullopt;
  return query.maybe([&] { return query.id<SiteId>(); });
}

void store_tags(Connection& connection, std::int64_t key, const Mission& mission) {
  Query query(connection, k_insert_tag);
  std::int64_t ordinal = 0;
  for (const TagAntenna& tag : mission.tags) {
    query.again();
    const auto& arm = tag.lever_arm_body_m;
    query << key << ordinal++ << tag.tag << tag.antenna << arm.x() << arm.y() << arm.z();
    query.run();
  }
}

void bind(Query& query, const Mission& m) {
  query << m.id << m.site << m.name << m.kit << m.radio << static_cast<int>(m.frame)
        << static_cast<int>(m.point) << static_cast<int>(m.state) << m.created << m.finished
        << m.lever_arm_sigma_m;
}

Mission read_mission(Connection& connection, Query& query) {
  Mission m;
  const std::int64_t key = query.integer();
  m.id = query.id<MissionId>();
  m.site = query.maybe([&] { return query.id<SiteId>(); });
  m.name = query.text();
  m.kit = query.text();
  m.radio = query.text();
  m.frame = query.one_of(k_frame_words);
  m.point = query.one_of(k_point_words);
  m.state = query.one_of(k_mission_state_words);
  m.created = query.time();
  m.finished = query.maybe_time();
  m.lever_arm_sigma_m = query.maybe([&] { return query.real(); });
  Query tags(connection, k_tags);
  tags << key;
  while (tags.step()) {
    TagAntenna tag;
    tag.tag = tags.network_id();
    tag.antenna = tags.as<std::uint8_t>();
    for (int axis = 0; axis < 3; ++axis) tag.lever_arm_body_m[axis] = tags.real();
    m.tags.push_back(tag);
  }
  return m;
}

Result<Mission> find(Connection& c, const MissionId& id) {
  static const std::string text = std::string(k_mission_columns) + "WHERE id = ?1 AND " + k_not_binned;
  Query query(c, text);
  query << id;
  if (!query.step()) return no_mission(id);
  return read_mission(c, query);
}

class SqlMissionStore final : public MissionStore {
 public:
  SqlMissionStore(Gate& gate, AdmitMission admit) : gate_(gate), admit_(std::move(admit)) {}

  Result<void> insert(const Mission& mission) override {
    if (auto refusal = admit_()) return *std::move(refusal);
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query taken(c, k_id_taken);
      taken << mission.id;
      if (taken.step() && taken.integer() > 0)
        return make_error(Errc::conflict, "mission " + to_string(mission.id) + " exists");
      if (auto error = check_site(c, mission)) return error;
      // It will measure: of those there must be room for one at least.
      if (auto error = beyond_quota(c, mission.site, {1, 1, 0})) return error;
      Query query(c, k_mission_insert);
      bind(query, mission);
      store_tags(c, query.returned().value(), mission);
      return std::nullopt;
    });
  }

  Result<void> update(const Mission& mission) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = check_site(c, mission)) return error;
      const auto stored = mission_key(c, mission.id);
      if (!stored) return no_mission(mission.id);
      if (const auto from = site_of(c, *stored); from != mission.site)
        if (auto error = beyond_quota(c, mission.site, {1, count_measurements(c, *stored), 0}, from))
          return error;
      Query query(c, k_mission_update);
      bind(query, mission);
      const auto key = query.returned();
      if (!key) return no_mission(mission.id);
      Query drop(c, k_drop_tags);
      drop << *key;
      drop.run();
      store_tags(c, *key, mission);
      return std::nullopt;
    });
  }

  Result<Mission> finish(const MissionId& id, UtcTime now) override {
    return write_value<Mission>(gate_, 1, [&](Connection& c) -> Result<Mission> {
      Query query(c, k_mission_finish);
      query << id << now << static_cast<int>(MissionState::finished);
      const bool done = query.returned().has_value();
      auto mission = find(c, id);
      if (mission && !done) return make_error(Errc::conflict, mission.value().name + " is already finished");
      return mission;
    });
  }

  Result<Mission> mission(const MissionId& id) override {
    return read_value<Mission>(gate_, [&](Connection& c) { return find(c, id); });
  }

  Result<std::vector<Mission>> missions(std::size_t limit, const std::optional<MissionId>& after) override {
    return read_value<std::vector<Mission>>(gate_, [&](Connection& c) -> Result<std::vector<Mission>> {
      // By the database's own numbers: an id has the time of a clock in it that somebody may have set back.
      static const std::string first =
          std::string(k_mission_columns) + "WHERE " + k_not_binned + " ORDER BY mission_key DESC LIMIT ?1";
      static const std::string next = std::string(k_mission_columns) + "WHERE " + k_not_binned +
                                      " AND mission_key < (SELECT mission_key FROM mission WHERE id = ?1) "
                                      "ORDER BY mission_key DESC LIMIT ?2";
      Query query(c, after ? next : first);
      if (after) query << *after;
      query << row_limit(limit);
      std::vector<Mission> found;
      while (query.step()) found.push_back(read_mission(c, query));
      return found;
    });
  }

 private:
  Gate& gate_;
  AdmitMission admit_;
};

}  // namespace

std::unique_ptr<MissionStore> make_mission_store(Gate& gate, AdmitMission admit) {
  return std::make_unique<SqlMissionStore>(gate, std::move(admit));
}

std::optional<std::int64_t> mission_key(Connection& connection, const MissionId& id) {
  Query query(connection, k_mission_key);
  query << id;
  return query.step() ? std::optional(query.integer()) : std::nullopt;
}

std::vector<BinnedMission> read_binned_missions(Connection& connection) {
  static const std::string text = std::string(k_mission_columns) + "WHERE id = ?1";
  std::vector<BinnedMission> found;
  Query query(connection, k_binned);
  while (query.step()) {
    BinnedMission one;
    one.deleted = query.time();
    one.deleted_ran_ns = query.integer();
    one.deleted_by = query.text();
    one.emptying = query.integer() != 0;
    one.n_ranges = query.as<std::uint64_t>();
    one.n_fixes = query.as<std::uint64_t>();
    Query mission(connection, text);
    mission << query.id<MissionId>();
    if (mission.step()) one.mission = read_mission(connection, mission);
    found.push_back(std::move(one));
  }
  return found;
}

std::int64_t row_limit(std::size_t limit) {
  return static_cast<std::int64_t>(std::min<std::size_t>(limit, std::numeric_limits<std::int32_t>::max()));
}

}  // namespace anchord::sql
