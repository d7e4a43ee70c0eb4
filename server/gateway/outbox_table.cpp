#include "server/gateway/outbox_table.hpp"

#include <algorithm>
#include <span>
#include <vector>

#include "server/storage/data_folder.hpp"

namespace anchord::gateway {

namespace fs = std::filesystem;
using sql::Connection;
using sql::Query;
using sql::SqliteConnection;

namespace {

constexpr std::int64_t k_application_id = 0x414e4f42;  // "ANOB"
constexpr std::int64_t k_version = 1;

constexpr const char* k_schema = R"(
CREATE TABLE batch(
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  mission BLOB NOT NULL,
  lines INTEGER NOT NULL,
  n_rows INTEGER NOT NULL,
  newest_ns INTEGER NOT NULL,
  body BLOB NOT NULL);
CREATE INDEX batch_of_mission ON batch(mission, id);
CREATE TABLE total(
  one INTEGER PRIMARY KEY CHECK(one = 1),
  kept INTEGER NOT NULL, accepted INTEGER NOT NULL, duplicates INTEGER NOT NULL, rejected INTEGER NOT NULL,
  mission BLOB, mission_at_ns INTEGER);
INSERT INTO total VALUES(1, 0, 0, 0, 0, NULL, NULL);
)";

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span{text}); }
std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Error not_an_outbox(const fs::path& file, const std::string& why) {
  return make_error(
      Errc::unsupported,
      file.string() + " " + why + ": use another --data-dir, or the anchord version that created it");
}

/// No table yet: new, or killed before the tables were there.
bool is_empty(SqliteConnection& c) {
  Query q(c, "SELECT count(*) FROM sqlite_master");
  return q.step() && q.integer() == 0 && c.pragma("application_id") == 0;
}

Batch read_batch(Query& q) {
  Batch batch;
  batch.id = q.integer();
  batch.mission = q.id<MissionId>();
  batch.lines = q.one_of(k_lines_words);
  batch.n_rows = q.as<std::uint32_t>();
  batch.newest = q.time();
  batch.body = text_of(q.blob());
  return batch;
}

/// As many as fit, one at least, without those of `gone`; `more` says whether there was another.
std::vector<Batch> read_batches(Query& q, const Ids& gone, std::uint64_t max_bytes, bool& more) {
  std::vector<Batch> out;
  more = false;
  for (std::uint64_t bytes = 0; q.step();) {
    auto batch = read_batch(q);
    if (gone.contains(batch.id)) continue;
    bytes += batch.body.size();
    if (!out.empty() && bytes > max_bytes) {
      more = true;
      break;
    }
    out.push_back(std::move(batch));
  }
  return out;
}

std::vector<Batch> oldest_of(Connection& c, const MissionId& mission, std::int64_t until, const Ids& gone,
                             std::uint64_t max_bytes) {
  Query q(c,
          "SELECT id, mission, lines, n_rows, newest_ns, body FROM batch WHERE mission = ?1 AND id <= ?2 "
          "ORDER BY id");
  q << mission << until;
  bool more = false;
  return read_batches(q, gone, max_bytes, more);
}

}  // namespace

/// A new file gets its tables; any other must be an outbox, whole and not newer.
Result<void> prepare(SqliteConnection& c, const fs::path& file) {
  if (is_empty(c)) {
    c.execute("BEGIN IMMEDIATE");
    c.execute("PRAGMA application_id=" + std::to_string(k_application_id));
    c.execute("PRAGMA user_version=" + std::to_string(k_version));
    c.execute(k_schema);
    c.execute("COMMIT");
    return sql::sync_path(file.parent_path());
  }
  if (c.pragma("application_id") != k_application_id)
    return not_an_outbox(file, "is not the outbox of a gateway");
  if (c.pragma("user_version") != k_version) return not_an_outbox(file, "is of a newer anchord");
  const std::string found = c.check(false);
  if (found == "ok") return boost::outcome_v2::success();
  return make_error(Errc::storage_unavailable, "the outbox " + file.string() + " is damaged (" + found +
                                                   "): move it and its -wal aside and start again; 'anchord "
                                                   "replay' restores its rows from the recordings beside it");
}

/// Of the mission whose batch has waited longest and that may be sent.
std::vector<Batch> oldest_on_disk(Connection& c, std::int64_t until, const std::set<MissionId>& waiting,
                                  const Ids& gone, std::uint64_t max_bytes) {
  const auto may_go = [&](const MissionId& id) { return id != unassigned() && !waiting.contains(id); };
  {
    Query first(c, "SELECT mission FROM batch WHERE id <= ?1 ORDER BY id LIMIT 1");
    first << until;
    if (!first.step()) return {};
    if (const auto id = first.id<MissionId>(); may_go(id))
      if (auto found = oldest_of(c, id, until, gone, max_bytes); !found.empty()) return found;
  }
  std::vector<MissionId> missions;
  {
    Query each(c,
               "SELECT mission, min(id) AS first FROM batch WHERE id <= ?1 GROUP BY mission ORDER BY first");
    each << until;
    while (each.step()) missions.push_back(each.id<MissionId>());
  }
  for (const auto& id : missions)
    if (may_go(id))
      if (auto found = oldest_of(c, id, until, gone, max_bytes); !found.empty()) return found;
  return {};
}

Newest newest_on_disk(Connection& c, std::int64_t after, const Ids& gone, std::uint64_t max_bytes) {
  Newest found;
  const MissionId none = unassigned();  // what is bound must live as long as the query
  Query q(c,
          "SELECT id, mission, lines, n_rows, newest_ns, body FROM batch WHERE id > ?1 AND mission <> ?2 "
          "ORDER BY id DESC");
  q << after << none;
  found.batches = read_batches(q, gone, max_bytes, found.more);
  return found;
}

std::optional<UtcTime> oldest_time_on_disk(Connection& c, const Ids& gone) {
  Query q(c, "SELECT id, newest_ns FROM batch ORDER BY id");
  while (q.step()) {
    const bool waits = !gone.contains(q.integer());
    const UtcTime at = q.time();
    if (waits) return at;
  }
  return std::nullopt;
}

Size size_of(Connection& c, const std::vector<std::int64_t>& ids) {
  Size out;
  for (const auto id : ids) {
    Query q(c, "SELECT n_rows, length(body) FROM batch WHERE id = ?1");
    q << id;
    if (!q.step()) continue;
    out.rows += q.as<std::uint64_t>();
    out.bytes += weight(q.as<std::uint64_t>());
  }
  return out;
}

void insert(Connection& c, const Batch& batch) {
  Query q(c, "INSERT INTO batch(id, mission, lines, n_rows, newest_ns, body) VALUES(?1, ?2, ?3, ?4, ?5, ?6)");
  q << batch.id << batch.mission << static_cast<int>(batch.lines) << static_cast<int>(batch.n_rows)
    << batch.newest << bytes_of(batch.body);
  q.run();
}

Size remove(Connection& c, std::int64_t id) {
  Size out;
  Query q(c, "DELETE FROM batch WHERE id = ?1 RETURNING n_rows, length(body)");
  q << id;
  while (q.step()) {
    out.rows += q.as<std::uint64_t>();
    out.bytes += weight(q.as<std::uint64_t>());
  }
  return out;
}

void add_totals(Connection& c, const Totals& more) {
  Query total(c,
              "UPDATE total SET kept = kept + ?1, accepted = accepted + ?2, duplicates = duplicates + ?3, "
              "rejected = rejected + ?4");
  total << more.kept << more.accepted << more.duplicates << more.rejected;
  total.run();
}

OutboxState counted(Connection& c, std::uint64_t max_bytes) {
  OutboxState out;
  out.max_bytes = max_bytes;
  {
    Query q(c,
            "SELECT ifnull(sum(n_rows), 0), ifnull(sum(length(body)), 0), count(*), ifnull((SELECT seq FROM "
            "sqlite_sequence WHERE name = 'batch'), 0) FROM batch");
    if (q.step()) {
      out.rows = q.as<std::uint64_t>();
      const auto body_bytes = q.as<std::uint64_t>();
      out.bytes = body_bytes + q.as<std::uint64_t>() * weight(std::uint64_t{0});
      out.newest_id = q.integer();
    }
  }
  {
    const MissionId none = unassigned();
    Query q(c, "SELECT ifnull(sum(n_rows), 0) FROM batch WHERE mission = ?1");
    q << none;
    if (q.step()) out.unassigned_rows = q.as<std::uint64_t>();
  }
  {
    Query q(c, "SELECT kept, accepted, duplicates, rejected FROM total");
    if (q.step()) {
      out.totals.kept = q.as<std::uint64_t>();
      out.totals.accepted = q.as<std::uint64_t>();
      out.totals.duplicates = q.as<std::uint64_t>();
      out.totals.rejected = q.as<std::uint64_t>();
    }
  }
  return out;
}

}  // namespace anchord::gateway
