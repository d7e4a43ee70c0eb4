#include "server/gateway/outbox.hpp"

#include <algorithm>
#include <mutex>
#include <span>
#include <utility>

#include "core/base/locked.hpp"
#include "core/base/whole_file.hpp"
#include "server/gateway/disk_debt.hpp"
#include "server/gateway/outbox_table.hpp"
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

constexpr std::uint64_t k_checkpoint_wal_bytes = 4u << 20;
constexpr std::size_t k_readers = 2;
// Room for rows of a quarter of an hour when other programs have filled the disk.
constexpr std::uint64_t k_reserve_bytes = 16u << 20, k_keep_free_bytes = 64u << 20;
constexpr const char* k_made = "outbox.made";  ///< one was made here; from then on a missing one is a loss
constexpr const char* k_made_text = "The outbox of a gateway was made here: do not delete this file.\n";

Error missing(const fs::path& file) {
  return make_error(
      Errc::storage_unavailable,
      "the outbox " + file.string() +
          " is missing or empty, and one was made here before. Put the file back with its -wal (is the disk "
          "mounted?). Where it is lost, start once with --new-outbox; 'anchord replay' restores its rows "
          "from "
          "the recordings beside it");
}

/// Of one mission, as many as fit and one at least.
std::vector<Batch> oldest_in_memory(const std::map<std::int64_t, DiskDebt::Held>& held, std::int64_t until,
                                    const std::set<MissionId>& waiting, std::uint64_t max_bytes) {
  std::vector<Batch> out;
  std::uint64_t bytes = 0;
  for (const auto& [id, batch] : held) {
    if (id > until) break;
    if (batch->mission == unassigned() || waiting.contains(batch->mission)) continue;
    if (!out.empty() && batch->mission != out.front().mission) continue;
    bytes += batch->body.size();
    if (!out.empty() && bytes > max_bytes) break;
    out.push_back(*batch);
  }
  return out;
}

Totals sum(Totals a, const Totals& b) {
  a.kept += b.kept;
  a.accepted += b.accepted;
  a.duplicates += b.duplicates;
  a.rejected += b.rejected;
  return a;
}

}  // namespace

struct Outbox::State {
  using Open = std::function<std::unique_ptr<SqliteConnection>(SqliteConnection::Mode)>;
  State(std::unique_ptr<sql::DataFolder> of, const fs::path& file, const Open& open,
        std::unique_ptr<SqliteConnection> writer, OutboxState now)
      : folder(std::move(of)),
        counts(now),
        readers([open] { return open(SqliteConnection::Mode::read_only); }, k_readers),
        queue(std::move(writer), file, [open] { return open(SqliteConnection::Mode::read_write); },
              {[this] { return folder->give_up_reserve(); },
               [this] { folder->fill_reserve(k_keep_free_bytes); }},
              {200'000, 100, k_checkpoint_wal_bytes}) {}

  std::unique_ptr<sql::DataFolder> folder;  // its lock goes last
  Locked<OutboxState> counts;
  Locked<DiskDebt> debt;
  std::mutex writing;
  sql::ReaderPool readers;
  sql::WriteQueue queue;

  /// What goes to the disk in one transaction, beside all that waits for it.
  struct Change {
    std::vector<Batch> kept;
    std::vector<std::int64_t> gone;
    Totals totals;
  };
  /// While `writing` is held. Why the disk does not take it; then nothing has changed but DiskDebt::trouble.
  std::optional<Error> write(const Change& change);
  void number(std::vector<Batch>& batches);
  void note_trouble(const std::string& why) {
    auto owed = debt.lock();
    owed->trouble = why;
  }

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

Outbox::Outbox(std::unique_ptr<State> state) : state_(std::move(state)) {}
Outbox::~Outbox() = default;

Result<std::unique_ptr<Outbox>> Outbox::open(const fs::path& dir, std::uint64_t max_bytes, bool anew) {
  BOOST_OUTCOME_TRY(auto folder, sql::DataFolder::open(dir, k_reserve_bytes));
  if (folder->had_database() || !folder->postgres().empty() || fs::exists(folder->database())) {
    return make_error(
        Errc::conflict,
        dir.string() + " is the folder of a server: give the gateway a folder of its own with --data-dir");
  }
  const fs::path file = dir / "outbox.db";
  const bool fresh = !fs::exists(file) || fs::file_size(file) == 0;
  const bool made = fs::exists(dir / k_made);
  if (fresh && made && !anew) return missing(file);
  const auto open_as = [file](SqliteConnection::Mode mode) {
    return std::make_unique<SqliteConnection>(file, mode, Synchronous::full, std::nullopt);
  };
  try {
    auto writer = open_as(fresh ? SqliteConnection::Mode::create : SqliteConnection::Mode::read_write);
    if (writer->read_only_file())
      return make_error(Errc::storage_unavailable, "the outbox " + file.string() + " is read-only");
    BOOST_OUTCOME_TRYV(prepare(*writer, file));
    // A disk that is full is no reason to send nothing of an outbox that is there: the next start makes it.
    if (!made) (void)write_whole(dir / k_made, k_made_text);
    const auto now = counted(*writer, max_bytes);
    auto state = std::make_unique<State>(std::move(folder), file, open_as, std::move(writer), now);
    return std::unique_ptr<Outbox>(new Outbox(std::move(state)));
  } catch (const sql::SqlError& error) {
    return sql::to_error(error);
  }
}

void Outbox::State::number(std::vector<Batch>& batches) {
  auto now = counts.lock();
  for (auto& batch : batches) batch.id = ++now->newest_id;
}

std::optional<Error> Outbox::State::write(const Change& change) {
  std::uint64_t bytes = 0, rows = 0, without_mission = 0;
  for (const auto& batch : change.kept) {
    bytes += weight(batch);
    rows += batch.n_rows;
    if (batch.mission == unassigned()) without_mission += batch.n_rows;
  }
  std::map<std::int64_t, DiskDebt::Held> held;
  Ids undeleted;
  Totals totals = change.totals;
  std::uint64_t held_bytes = 0;
  {
    const auto owed = debt.lock();
    const auto now = counts.lock();
    if (now->bytes + bytes + owed->held_bytes() <= now->max_bytes) {
      held = owed->held();
      held_bytes = owed->held_bytes();
    }
    undeleted = owed->undeleted;
    totals = sum(totals, owed->uncounted);
  }
  totals.kept += rows;
  Size gone;
  const auto failed = queue.write(rows + held.size() + change.gone.size() + undeleted.size(),
                                  [&](Connection& c) -> std::optional<Error> {
                                    gone = {};
                                    for (const auto& [id, batch] : held) insert(c, *batch);
                                    for (const auto& batch : change.kept) insert(c, batch);
                                    for (const auto id : change.gone) {
                                      const Size one = remove(c, id);
                                      gone.rows += one.rows;
                                      gone.bytes += one.bytes;
                                    }
                                    // Their rows wait no more since the server answered for them.
                                    for (const auto id : undeleted) gone.bytes += remove(c, id).bytes;
                                    add_totals(c, totals);
                                    return std::nullopt;
                                  });
  auto owed = debt.lock();
  if (failed) {
    owed->trouble = failed->message;
    return failed;
  }
  if (!held.empty()) owed->stored();
  owed->undeleted.clear();
  owed->uncounted = {};
  if (owed->held().empty()) owed->trouble.clear();
  auto now = counts.lock();
  now->bytes += bytes + held_bytes;
  now->bytes -= std::min(now->bytes, gone.bytes);
  now->rows += rows;
  now->rows -= std::min(now->rows, gone.rows);
  now->unassigned_rows += without_mission;
  now->totals.kept += rows;
  return std::nullopt;
}

Result<void> Outbox::keep(std::vector<Batch> batches) {
  const std::lock_guard one(state_->writing);
  std::uint64_t bytes = 0;
  for (const auto& batch : batches) bytes += weight(batch);
  const auto now = state_->counts.copy();
  if (now.bytes + bytes > now.max_bytes) {
    auto full =
        make_error(Errc::storage_full, "the outbox is full: " + std::to_string(now.rows) + " rows wait in " +
                                           std::to_string(now.bytes >> 20) + " MiB (limit " +
                                           std::to_string(now.max_bytes >> 20) + " MiB, --max-mib)");
    state_->note_trouble(full.message);
    return full;
  }
  state_->number(batches);
  if (auto failed = state_->write({std::move(batches), {}, {}})) return *std::move(failed);
  return boost::outcome_v2::success();
}

bool Outbox::hold(std::vector<Batch> batches) {
  const std::lock_guard one(state_->writing);
  state_->number(batches);
  std::uint64_t rows = 0, without_mission = 0;
  for (const auto& batch : batches) {
    rows += batch.n_rows;
    if (batch.mission == unassigned()) without_mission += batch.n_rows;
  }
  auto owed = state_->debt.lock();
  if (!owed->hold(std::move(batches), k_most_held_bytes)) return false;
  owed->uncounted.kept += rows;
  auto now = state_->counts.lock();
  now->rows += rows;
  now->unassigned_rows += without_mission;
  now->totals.kept += rows;
  return true;
}

bool Outbox::try_disk() {
  const std::lock_guard one(state_->writing);
  {
    const auto owed = state_->debt.lock();
    if (owed->trouble.empty() && owed->none()) return true;
  }
  if (state_->write({})) return false;
  const auto owed = state_->debt.lock();
  return owed->none();
}

bool Outbox::delivered(const Delivered& delivered) {
  const std::lock_guard one(state_->writing);
  const Totals totals{0, delivered.accepted, delivered.duplicates, delivered.rejected};
  std::vector<std::int64_t> on_disk;
  std::uint64_t rows = 0;
  {
    auto owed = state_->debt.lock();
    for (const auto id : delivered.ids) {
      if (const auto released = owed->release(id))
        rows += *released;
      else
        on_disk.push_back(id);
    }
  }
  const bool written = !state_->write({{}, on_disk, totals});
  if (!written) {
    const auto left = state_->read<Size>([&](Connection& c) { return size_of(c, on_disk); });
    if (left) rows += left.value().rows;
    auto owed = state_->debt.lock();
    owed->undeleted.insert(on_disk.begin(), on_disk.end());
    owed->uncounted = sum(owed->uncounted, totals);
  }
  auto now = state_->counts.lock();
  now->rows -= std::min(now->rows, rows);
  now->totals = sum(now->totals, totals);
  return written;
}

Result<Newest> Outbox::newest(std::int64_t after, std::uint64_t max_bytes) {
  const auto owed = state_->debt.copy();
  BOOST_OUTCOME_TRY(auto out, state_->read<Newest>([&](Connection& c) {
    return newest_on_disk(c, after, owed.undeleted, max_bytes);
  }));
  std::set<std::int64_t> there;
  for (const auto& batch : out.batches) there.insert(batch.id);
  for (const auto& [id, batch] : owed.held())
    if (id > after && batch->mission != unassigned() && !there.contains(id)) out.batches.push_back(*batch);
  if (there.size() == out.batches.size()) return out;
  std::ranges::sort(out.batches, std::ranges::greater{}, &Batch::id);
  std::uint64_t bytes = 0;
  const auto beyond = std::ranges::find_if(
      out.batches, [&](const Batch& batch) { return (bytes += batch.body.size()) > max_bytes; });
  const auto first = out.batches.begin() + 1;
  if (beyond == out.batches.end()) return out;
  out.more = true;
  out.batches.erase(std::max(beyond, first), out.batches.end());
  return out;
}

Result<std::vector<Batch>> Outbox::oldest(std::int64_t until, const std::set<MissionId>& held,
                                          std::uint64_t max_bytes) {
  const auto owed = state_->debt.copy();
  BOOST_OUTCOME_TRY(auto found, state_->read<std::vector<Batch>>([&](Connection& c) {
    return oldest_on_disk(c, until, held, owed.undeleted, max_bytes);
  }));
  if (!found.empty()) return found;
  return oldest_in_memory(owed.held(), until, held, max_bytes);
}

Result<std::uint64_t> Outbox::assign(const MissionId& mission) {
  const std::lock_guard one(state_->writing);
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
  auto owed = state_->debt.lock();
  rows += owed->assign(mission);
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

OutboxState Outbox::state() const {
  OutboxState out = state_->counts.copy();
  const auto owed = state_->debt.lock();
  out.rows_in_memory = owed->held_rows();
  out.trouble = owed->trouble;
  return out;
}

std::optional<UtcTime> Outbox::oldest_waiting() {
  const auto owed = state_->debt.copy();
  const auto found = state_->read<std::optional<UtcTime>>(
      [&](Connection& c) { return oldest_time_on_disk(c, owed.undeleted); });
  if (found && found.value()) return found.value();
  return owed.held().empty() ? std::nullopt : std::optional(owed.held().begin()->second->newest);
}

}  // namespace anchord::gateway
