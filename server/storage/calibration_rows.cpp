#include "server/storage/calibration_rows.hpp"

#include <algorithm>

#include "server/storage/measurement_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_calibration_insert =
    "INSERT INTO calibration (id, frame, origin_lat_deg, origin_lon_deg, origin_height_m, settings_json, "
    "created_t_ns, provenance_json) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8) ON CONFLICT DO NOTHING RETURNING calibration_key";
constexpr const char* k_insert_mission =
    "INSERT INTO calibration_mission (calibration_key, ordinal, mission_key) VALUES (?1, ?2, ?3)";
constexpr const char* k_calibration_columns =
    "SELECT calibration_key, id, frame, origin_lat_deg, origin_lon_deg, origin_height_m, settings_json, "
    "created_t_ns, provenance_json FROM calibration ";
constexpr const char* k_insert_evidence =
    "INSERT INTO calibration_evidence (calibration_key, evidence_json) VALUES (?1, ?2)";
constexpr const char* k_evidence =
    "SELECT evidence_json FROM calibration_evidence e JOIN calibration c ON c.calibration_key = "
    "e.calibration_key WHERE c.id = ?1";
constexpr const char* k_missions =
    "SELECT m.id FROM calibration_mission cm JOIN mission m ON m.mission_key = cm.mission_key "
    "WHERE cm.calibration_key = ?1 ORDER BY cm.ordinal";
constexpr const char* k_calibration_key = "SELECT calibration_key FROM calibration WHERE id = ?1";
constexpr const char* k_revisions_of = "SELECT count(*) FROM revision WHERE calibration_key = ?1";
constexpr const char* k_calibration_remove = "DELETE FROM calibration WHERE calibration_key = ?1";

constexpr const char* k_calibration_newest = "SELECT coalesce(max(number), 0) FROM revision";
constexpr const char* k_insert_revision =
    "INSERT INTO revision (number, calibration_key, published_t_ns, published_by, note) VALUES (?1, ?2, ?3, "
    "?4, ?5)";
constexpr const char* k_carry_on =
    "INSERT INTO revision_position (number, network_id, since_number) "
    "SELECT ?1, network_id, since_number FROM revision_position WHERE number = ?2";
constexpr const char* k_set_position =
    "INSERT INTO revision_position (number, network_id, since_number) VALUES (?1, ?2, ?1) "
    "ON CONFLICT (number, network_id) DO UPDATE SET since_number = excluded.since_number";
constexpr const char* k_stands =
    "SELECT 1 FROM revision_position p JOIN revision r ON r.number = p.since_number "
    "WHERE p.number = ?1 AND p.network_id = ?2 AND r.calibration_key = ?3";
constexpr const char* k_insert_override =
    "INSERT INTO revision_override (number, network_id, reason, overridden_by) VALUES (?1, ?2, ?3, ?4)";
constexpr const char* k_override =
    "SELECT reason, overridden_by FROM revision_override WHERE number = ?1 AND network_id = ?2";
constexpr const char* k_calibration_revisions =
    "SELECT r.number, c.id, r.published_t_ns, r.published_by, r.note FROM revision r "
    "JOIN calibration c ON c.calibration_key = r.calibration_key "
    "WHERE ?1 = 0 OR r.number < ?1 ORDER BY r.number DESC LIMIT ?2";
constexpr const char* k_revision_exists = "SELECT count(*) FROM revision WHERE number = ?1";
constexpr const char* k_position_columns =
    "SELECT p.network_id, p.since_number, c.calibration_key, c.id, r.published_t_ns, c.frame, "
    "c.origin_lat_deg, "
    "c.origin_lon_deg, c.origin_height_m FROM revision_position p JOIN revision r ON r.number = "
    "p.since_number "
    "JOIN calibration c ON c.calibration_key = r.calibration_key ";

std::optional<std::int64_t> key_of(Connection& c, const CalibrationId& id) {
  Query query(c, k_calibration_key);
  query << id;
  return query.step() ? std::optional(query.integer()) : std::nullopt;
}

std::uint64_t newest_revision(Connection& c) {
  Query query(c, k_calibration_newest);
  return query.step() ? query.as<std::uint64_t>() : 0;
}

Calibration read_calibration(Connection& c, Query& query) {
  Calibration found;
  const std::int64_t key = query.integer();
  found.id = query.id<CalibrationId>();
  found.frame = query.one_of(k_frame_words);
  found.origin = read_wgs84(query);
  found.settings = query.document();
  found.created = query.time();
  found.provenance = query.document();
  Query missions(c, k_missions);
  missions << key;
  while (missions.step()) found.missions.push_back(missions.id<MissionId>());
  found.anchors = read_estimates(c, key);
  return found;
}

std::vector<PublishedPosition> read_positions(Connection& c, Query& query) {
  std::vector<PublishedPosition> found;
  while (query.step()) {
    PublishedPosition position;
    const NetworkId anchor = query.network_id();
    position.since_revision = query.as<std::uint64_t>();
    const std::int64_t key = query.integer();
    position.calibration = query.id<CalibrationId>();
    position.published = query.time();
    position.frame = query.one_of(k_frame_words);
    position.origin = read_wgs84(query);
    auto estimate = read_estimate(c, key, anchor);
    if (!estimate) throw SqlError(Failure::damaged, "a published position without its estimate");
    position.estimate = *std::move(estimate);
    Query overridden(c, k_override);
    overridden << position.since_revision << anchor;
    if (overridden.step()) {
      std::string reason = overridden.text();
      position.overridden = Override{anchor, std::move(reason), overridden.text()};
    }
    found.push_back(std::move(position));
  }
  return found;
}

/// Whether each of these anchors has its position of this calibration in that revision.
bool all_stand(Connection& c, std::uint64_t revision, std::int64_t calibration_key,
               const std::vector<NetworkId>& anchors) {
  Query query(c, k_stands);
  return !anchors.empty() && std::ranges::all_of(anchors, [&](NetworkId anchor) {
    query.again();
    query << revision << anchor << calibration_key;
    return query.step();
  });
}

std::optional<Error> check_duplicates(const Calibration& calibration) {
  std::vector<NetworkId> ids;
  for (const Estimate& e : calibration.anchors) ids.push_back(e.anchor);
  std::ranges::sort(ids);
  const auto twice = std::ranges::adjacent_find(ids);
  if (twice == ids.end()) return std::nullopt;
  return make_error(Errc::invalid_argument, "calibration with two estimates of anchor " + to_string(*twice));
}

}  // namespace

std::optional<Error> insert_calibration(Connection& c, const Calibration& calibration) {
  if (auto error = check_duplicates(calibration)) return error;
  std::optional<std::int64_t> key;
  {
    Query query(c, k_calibration_insert);
    query << calibration.id << static_cast<int>(calibration.frame);
    bind_wgs84(query, calibration.origin);
    query << calibration.settings << calibration.created << calibration.provenance;
    key = query.returned();
  }
  if (!key) return make_error(Errc::conflict, "calibration " + to_string(calibration.id) + " exists");
  std::int64_t ordinal = 0;
  for (const MissionId& mission : calibration.missions) {
    const auto of = mission_key(c, mission);
    if (!of) return make_error(Errc::not_found, "no mission " + to_string(mission));
    Query query(c, k_insert_mission);
    query << *key << ordinal++ << *of;
    query.run();
  }
  store_estimates(c, *key, calibration.anchors);
  if (!calibration.evidence.empty()) {
    Query query(c, k_insert_evidence);
    query << *key << calibration.evidence;
    query.run();
  }
  return std::nullopt;
}

Result<Calibration> find_calibration(Connection& c, const CalibrationId& id) {
  Query query(c, std::string(k_calibration_columns) + "WHERE id = ?1");
  query << id;
  if (!query.step()) return absent("calibration", id);
  return read_calibration(c, query);
}

Result<std::vector<Calibration>> list_calibrations(Connection& c, std::int64_t limit,
                                                   const std::optional<CalibrationId>& after) {
  Query query(c, std::string(k_calibration_columns) +
                     (after ? "WHERE id < ?1 ORDER BY id DESC LIMIT ?2" : "ORDER BY id DESC LIMIT ?1"));
  if (after) query << *after;
  query << limit;
  std::vector<Calibration> found;
  while (query.step()) found.push_back(read_calibration(c, query));
  return found;
}

Result<std::string> find_evidence(Connection& c, const CalibrationId& id) {
  if (!key_of(c, id)) return absent("calibration", id);
  Query query(c, k_evidence);
  query << id;
  return query.step() ? query.text() : std::string{};
}

std::optional<Error> remove_calibration(Connection& c, const CalibrationId& id) {
  const auto key = key_of(c, id);
  if (!key) return absent("calibration", id);
  Query used(c, k_revisions_of);
  used << *key;
  if (used.step() && used.integer() > 0) {
    return make_error(Errc::conflict, "calibration " + to_string(id) + " was published");
  }
  Query query(c, k_calibration_remove);
  query << *key;
  query.run();
  return std::nullopt;
}

Result<Revision> publish_revision(Connection& c, const CalibrationId& id,
                                  const std::vector<NetworkId>& anchors, std::string_view by,
                                  std::string_view note, UtcTime now, const std::vector<Override>& overrides,
                                  std::optional<std::uint64_t> decided_on) {
  const auto key = key_of(c, id);
  if (!key) return absent("calibration", id);
  const std::uint64_t before = newest_revision(c);
  if (decided_on && *decided_on != before)
    return make_error(Errc::conflict, "revision " + std::to_string(before) +
                                          " was published in the meantime: read the anchors again");
  if (all_stand(c, before, *key, anchors))
    return make_error(Errc::conflict, "revision " + std::to_string(before) +
                                          " already has these positions of calibration " + to_string(id) +
                                          " already");
  const Revision revision{before + 1, id, now, std::string(by), std::string(note)};
  Query insert(c, k_insert_revision);
  insert << revision.number << *key << now << by << note;
  insert.run();
  Query carry_on(c, k_carry_on);
  carry_on << revision.number << before;
  carry_on.run();
  for (const NetworkId anchor : anchors) {
    const auto estimate = read_estimate(c, *key, anchor);
    if (!estimate || !estimate->best) {
      return make_error(Errc::invalid_argument,
                        "anchor " + to_string(anchor) + " has no position in this calibration");
    }
    Query set(c, k_set_position);
    set << revision.number << anchor;
    set.run();
  }
  for (const Override& one : overrides) {
    if (std::ranges::find(anchors, one.anchor) == anchors.end())
      return make_error(Errc::invalid_argument,
                        "override of anchor " + to_string(one.anchor) + ", which is not published");
    Query insert_override(c, k_insert_override);
    insert_override << revision.number << one.anchor << one.reason << one.by;
    insert_override.run();
  }
  return revision;
}

Result<std::vector<Revision>> list_revisions(Connection& c, std::int64_t limit, std::uint64_t before) {
  Query query(c, k_calibration_revisions);
  query << before << limit;
  std::vector<Revision> found;
  while (query.step()) {
    Revision r;
    r.number = query.as<std::uint64_t>();
    r.calibration = query.id<CalibrationId>();
    r.published = query.time();
    r.by = query.text();
    r.note = query.text();
    found.push_back(std::move(r));
  }
  return found;
}

Result<std::vector<PublishedPosition>> positions_of_revision(Connection& c,
                                                             std::optional<std::uint64_t> revision) {
  const std::uint64_t number = revision ? *revision : newest_revision(c);
  if (revision) {
    Query exists(c, k_revision_exists);
    exists << number;
    if (exists.step() && exists.integer() == 0) {
      return make_error(Errc::not_found, "no revision " + std::to_string(number));
    }
  }
  Query query(c, std::string(k_position_columns) + "WHERE p.number = ?1 ORDER BY p.network_id");
  query << number;
  return read_positions(c, query);
}

Result<std::optional<PublishedPosition>> position_in_revision(Connection& c, NetworkId network_id,
                                                              std::uint64_t revision) {
  Query query(c, std::string(k_position_columns) + "WHERE p.number = ?1 AND p.network_id = ?2");
  query << revision << network_id;
  auto found = read_positions(c, query);
  return found.empty() ? std::nullopt : std::optional(std::move(found.front()));
}

Result<std::vector<PublishedPosition>> positions_of_anchor(Connection& c, NetworkId network_id) {
  Query query(c, std::string(k_position_columns) +
                     "WHERE p.network_id = ?1 AND p.number = p.since_number ORDER BY p.number DESC");
  query << network_id;
  return read_positions(c, query);
}

}  // namespace anchord::sql
