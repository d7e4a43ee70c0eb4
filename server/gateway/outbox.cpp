#include "server/gateway/outbox.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "core/base/locked.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/reader_pool.hpp"
#include "server/storage/sqlite_connection.hpp"
#include "server/storage/write_queue.hpp"

namespace anchord::gateway {
namespace {

namespace fs = std::filesystem;
using sql::Connection;
using sql::Query;
using sql::SqliteConnection;

constexpr std::int64_t k_application_id = 0x414e4f42;  // "ANOB"
constexpr std::int64_t k_version = 1;
constexpr std::uint64_t k_batch_overhead_bytes = 120;  ///< of a row of the table with its place in two trees
constexpr std::uint64_t k_checkpoint_wal_bytes = 4u << 20;
constexpr std::size_t k_readers = 2;

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

/// As many as fit, one at least; `more` says whether there was another.
std::vector<Batch> read_batches(Query& q, std::uint64_t max_bytes, bool& more) {
  std::vector<Batch> out;
  more = false;
  for (std::uint64_t bytes = 0; q.step();) {
    auto batch = read_batch(q);
    bytes += batch.body.size();
    if (!out.empty() && bytes > max_bytes) {
      more = true;
      break;
    }
    out.push_back(std::move(batch));
  }
  return out;
}

/// The mission of the oldest batch that may be sent.
std::optional<MissionId> oldest_mission(Connection& c, std::int64_t until, const std::set<MissionId>& held) {
  const auto may_go = [&](const MissionId& id) { return id != unassigned() && !held.contains(id); };
  {
    Query first(c, "SELECT mission FROM batch WHERE id <= ?1 ORDER BY id LIMIT 1");
    first << until;
    if (!first.step()) return std::nullopt;
    if (const auto id = first.id<MissionId>(); may_go(id)) return id;
  }
  Query each(c, "SELECT mission, min(id) AS first FROM batch WHERE id <= ?1 GROUP BY mission ORDER BY first");
  each << until;
  while (each.step()) {
    if (const auto id = each.id<MissionId>(); may_go(id)) return id;
  }
  return std::nullopt;
}

std::uint64_t weight(std::uint64_t body_bytes) { return body_bytes + k_batch_overhead_bytes; }

}  // namespace

MissionId unassigned() {
  MissionId id;
  id.uuid.bytes.fill(0xff);
  return id;
}

struct Outbox::State {
  using Open = std::function<std::unique_ptr<SqliteConnection>(SqliteConnection::Mode)>;
  State(std::unique_ptr<sql::DataFolder> of, const fs::path& file, const Open& open,
        std::unique_ptr<SqliteConnection> writer, OutboxState now)
      : folder(std::move(of)),
        counts(now),
        readers([open] { return open(SqliteConnection::Mode::read_only); }, k_readers),
        queue(std::move(writer), file, [open] { return open(SqliteConnection::Mode::read_write); },
              {[] { return false; }, [] {}}, {200'000, 100, k_checkpoint_wal_bytes}) {}

  std::unique_ptr<sql::DataFolder> folder;  // its lock goes last
  Locked<OutboxState> counts;
  sql::ReaderPool readers;
  sql::WriteQueue queue;

  template <class T, class F>
  Result<T> read(F work) {
    T value{};
    if (auto error = readers.read([&](Connection& c) -> std::optional<Error> {
          value = work(c);
          return std::nullopt;
        }))
      return *std::move(error);
    return value;
  }
};

namespace {

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
      out.bytes = body_bytes + q.as<std::uint64_t>() * k_batch_overhead_bytes;
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

}  // namespace

Outbox::Outbox(std::unique_ptr<State> state) : state_(std::move(state)) {}
Outbox::~Outbox() = default;

Result<std::unique_ptr<Outbox>> Outbox::open(const fs::path& dir, std::uint64_t max_bytes) {
  BOOST_OUTCOME_TRY(auto folder, sql::DataFolder::open(dir, 0));
  if (folder->had_database() || !folder->postgres().empty() || fs::exists(folder->database())) {
    return make_error(
        Errc::conflict,
        dir.string() + " is the folder of a server: give the gateway a folder of its own with --data-dir");
  }
  const fs::path file = dir / "outbox.db";
  const bool fresh = !fs::exists(file) || fs::file_size(file) == 0;
  const auto open_as = [file](SqliteConnection::Mode mode) {
    return std::make_unique<SqliteConnection>(file, mode, Synchronous::full, std::nullopt);
  };
  try {
    auto writer = open_as(fresh ? SqliteConnection::Mode::create : SqliteConnection::Mode::read_write);
    if (writer->read_only_file())
      return make_error(Errc::storage_unavailable, "the outbox " + file.string() + " is read-only");
    BOOST_OUTCOME_TRYV(prepare(*writer, file));
    const auto now = counted(*writer, max_bytes);
    auto state = std::make_unique<State>(std::move(folder), file, open_as, std::move(writer), now);
    return std::unique_ptr<Outbox>(new Outbox(std::move(state)));
  } catch (const sql::SqlError& error) {
    return sql::to_error(error);
  }
}

Result<void> Outbox::keep(std::vector<Batch> batches) {
  std::uint64_t bytes = 0, rows = 0, without_mission = 0;
  for (const auto& batch : batches) {
    bytes += weight(batch.body.size());
    rows += batch.n_rows;
    if (batch.mission == unassigned()) without_mission += batch.n_rows;
  }
  {
    const auto counts = state_->counts.lock();
    if (counts->bytes + bytes > counts->max_bytes) {
      return make_error(Errc::storage_full, "the outbox is full: " + std::to_string(counts->rows) +
                                                " rows wait in " + std::to_string(counts->bytes >> 20) +
                                                " MiB (limit " + std::to_string(counts->max_bytes >> 20) +
                                                " MiB, --max-mib)");
    }
  }
  std::int64_t newest_id = 0;
  const auto failed = state_->queue.write(rows, [&](Connection& c) -> std::optional<Error> {
    for (const auto& batch : batches) {
      Query q(c, "INSERT INTO batch(mission, lines, n_rows, newest_ns, body) VALUES(?1, ?2, ?3, ?4, ?5)");
      q << batch.mission << static_cast<int>(batch.lines) << static_cast<int>(batch.n_rows) << batch.newest
        << bytes_of(batch.body);
      newest_id = q.inserted("id").value_or(newest_id);
    }
    Query total(c, "UPDATE total SET kept = kept + ?1");
    total << rows;
    total.run();
    return std::nullopt;
  });
  if (failed) return *failed;
  auto counts = state_->counts.lock();
  counts->bytes += bytes;
  counts->rows += rows;
  counts->unassigned_rows += without_mission;
  counts->totals.kept += rows;
  counts->newest_id = std::max(counts->newest_id, newest_id);
  return boost::outcome_v2::success();
}

Result<Newest> Outbox::newest(std::int64_t after, std::uint64_t max_bytes) {
  return state_->read<Newest>([&](Connection& c) {
    Newest out;
    const MissionId none = unassigned();  // what is bound must live as long as the query
    Query q(c,
            "SELECT id, mission, lines, n_rows, newest_ns, body FROM batch WHERE id > ?1 AND mission <> ?2 "
            "ORDER BY id DESC");
    q << after << none;
    out.batches = read_batches(q, max_bytes, out.more);
    return out;
  });
}

Result<std::vector<Batch>> Outbox::oldest(std::int64_t until, const std::set<MissionId>& held,
                                          std::uint64_t max_bytes) {
  return state_->read<std::vector<Batch>>([&](Connection& c) {
    const auto mission = oldest_mission(c, until, held);
    if (!mission) return std::vector<Batch>{};
    Query q(c,
            "SELECT id, mission, lines, n_rows, newest_ns, body FROM batch WHERE mission = ?1 AND id <= ?2 "
            "ORDER BY id");
    q << *mission << until;
    bool more = false;
    return read_batches(q, max_bytes, more);
  });
}

Result<void> Outbox::delivered(const Delivered& delivered) {
  std::uint64_t rows = 0, bytes = 0;
  const auto failed = state_->queue.write(delivered.ids.size(), [&](Connection& c) -> std::optional<Error> {
    rows = bytes = 0;
    for (const auto id : delivered.ids) {
      Query q(c, "DELETE FROM batch WHERE id = ?1 RETURNING n_rows, length(body)");
      q << id;
      while (q.step()) {
        rows += q.as<std::uint64_t>();
        bytes += weight(q.as<std::uint64_t>());
      }
    }
    Query total(c,
                "UPDATE total SET accepted = accepted + ?1, duplicates = duplicates + ?2, "
                "rejected = rejected + ?3");
    total << delivered.accepted << delivered.duplicates << delivered.rejected;
    total.run();
    return std::nullopt;
  });
  if (failed) return *failed;
  auto counts = state_->counts.lock();
  counts->rows -= std::min(counts->rows, rows);
  counts->bytes -= std::min(counts->bytes, bytes);
  counts->totals.accepted += delivered.accepted;
  counts->totals.duplicates += delivered.duplicates;
  counts->totals.rejected += delivered.rejected;
  return boost::outcome_v2::success();
}

Result<std::uint64_t> Outbox::assign(const MissionId& mission) {
  std::uint64_t rows = 0;
  const auto failed = state_->queue.write(1, [&](Connection& c) -> std::optional<Error> {
    rows = 0;
    const MissionId none = unassigned();
    Query q(c, "UPDATE batch SET mission = ?1 WHERE mission = ?2 RETURNING n_rows");
    q << mission << none;
    while (q.step()) rows += q.as<std::uint64_t>();
    return std::nullopt;
  });
  if (failed) return *failed;
  auto counts = state_->counts.lock();
  counts->unassigned_rows -= std::min(counts->unassigned_rows, rows);
  return rows;
}

Result<std::optional<Outbox::LastMission>> Outbox::last_mission() {
  return state_->read<std::optional<LastMission>>([](Connection& c) -> std::optional<LastMission> {
    Query q(c, "SELECT mission, mission_at_ns FROM total");
    if (!q.step() || q.null()) return std::nullopt;
    const auto mission = q.id<MissionId>();
    return LastMission{mission, q.time()};
  });
}

Result<void> Outbox::note_mission(const LastMission& mission) {
  const auto failed = state_->queue.write(1, [&](Connection& c) -> std::optional<Error> {
    Query q(c, "UPDATE total SET mission = ?1, mission_at_ns = ?2");
    q << mission.mission << mission.at;
    q.run();
    return std::nullopt;
  });
  if (failed) return *failed;
  return boost::outcome_v2::success();
}

OutboxState Outbox::state() const { return state_->counts.copy(); }

std::optional<UtcTime> Outbox::oldest_waiting() {
  const auto found = state_->read<std::optional<UtcTime>>([](Connection& c) -> std::optional<UtcTime> {
    Query q(c, "SELECT newest_ns FROM batch ORDER BY id LIMIT 1");
    return q.step() ? std::optional(q.time()) : std::nullopt;
  });
  return found ? found.value() : std::nullopt;
}

}  // namespace anchord::gateway
