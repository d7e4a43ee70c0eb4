#include "server/storage/write_queue.hpp"

#include <utility>

#include "server/storage/backup.hpp"

namespace anchord::sql {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr auto k_idle = std::chrono::milliseconds(500);
constexpr auto k_write_queue_reopen_every = std::chrono::milliseconds(500);
constexpr auto k_save_every = std::chrono::seconds(30);
// One commit holds at most so much: a caller with one row should not wait for a flood before it.
constexpr std::size_t k_group_rows = 20'000;
constexpr std::size_t k_group_calls = 256;
constexpr std::uint64_t k_write_queue_page_bytes = 8192;

}  // namespace

WriteQueue::WriteQueue(std::unique_ptr<SqliteConnection> connection, std::filesystem::path file, Open open,
                       Reserve reserve, Limits limits)
    : file_(std::move(file)),
      open_(std::move(open)),
      reserve_(std::move(reserve)),
      limits_(limits),
      connection_(std::move(connection)),
      database_(file_),
      thread_("anchord-writer", [this] { run(); }) {}

WriteQueue::~WriteQueue() {
  {
    auto shared = shared_.lock();
    shared->stopping = true;
  }
  wake_writer_.notify_one();
  thread_.join();
}

std::optional<Error> WriteQueue::write(std::size_t rows, const Work& work) {
  Task task;
  task.rows = rows;
  task.work = &work;
  auto shared = shared_.lock();
  if (shared->stopping) return make_error(Errc::storage_unavailable, "the database is closing");
  const bool too_many_rows = shared->queued_rows > 0 && shared->queued_rows + rows > limits_.max_rows;
  if (too_many_rows || shared->queue.size() >= limits_.max_calls) {
    return make_error(Errc::queue_full, "the write queue is full: " + std::to_string(shared->queued_rows) +
                                            " rows in " + std::to_string(shared->queue.size()) +
                                            " calls are waiting");
  }
  shared->queue.push_back(&task);
  shared->queued_rows += rows;
  wake_writer_.notify_one();
  shared.wait(wake_callers_, [&](const Shared&) { return task.done; });
  return std::move(task.error);
}

WriteQueue::Status WriteQueue::status() const {
  const auto shared = shared_.lock();
  Status status = shared->status;
  status.queued_calls = shared->queue.size();
  status.queued_rows = shared->queued_rows;
  auto oldest = shared->writing_since;
  if (!oldest && !shared->queue.empty()) oldest = shared->queue.front()->since;
  if (oldest) status.oldest_s = std::chrono::duration<double>(SteadyClock::now() - *oldest).count();
  return status;
}

void WriteQueue::run() {
  // Once, so that the loop never ends for want of memory with callers that wait for it.
  Group group;
  group.reserve(k_group_calls);
  for (;;) {
    take(group);
    if (group.empty()) {
      (void)guarded("database writer", [this] {
        checkpoint_if(true);
        // A database that fell away is tried again also when nobody writes, so that readiness comes back by
        // itself.
        if (connection_ == nullptr) ensure_connection();
        watch_place();
        if (!status().trouble) reserve_.fill();
      });
      const auto shared = shared_.lock();
      if (shared->stopping && shared->queue.empty()) break;
      continue;
    }
    const auto ran = guarded("database writer", [&] { commit(group); });
    if (!ran) {
      // Nothing is known of what was written: a new connection recovers, and nobody is told that it is
      // stored.
      connection_.reset();
      for (Task* task : group) task->error = make_error(Errc::internal, "storage: " + ran.what);
    }
    {
      auto shared = shared_.lock();
      for (Task* task : group) task->done = true;
      shared->writing_since.reset();
    }
    wake_callers_.notify_all();
    (void)guarded("database writer", [this] {
      checkpoint_if(false);
      if (status().trouble) watch_place();
    });
  }
  connection_.reset();
}

/// Into the room that run() made.
void WriteQueue::take(Group& group) {
  group.clear();
  auto shared = shared_.lock();
  shared.wait_for(wake_writer_, k_idle, [](const Shared& s) { return s.stopping || !s.queue.empty(); });
  auto& queue = shared->queue;
  std::size_t rows = 0;
  while (!queue.empty() && group.size() < k_group_calls &&
         (group.empty() || rows + queue.front()->rows <= k_group_rows)) {
    rows += queue.front()->rows;
    group.push_back(queue.front());
    queue.pop_front();
  }
  shared->queued_rows -= rows;
  if (!group.empty()) shared->writing_since = group.front()->since;
}

void WriteQueue::commit(Group& group) {
  try {
    attempt(group);
    return;
  } catch (const SqlError& error) {
    const bool retry = error.failure() == Failure::full && (reserve_.give_up() || group.size() > 1);
    if (!retry) return fail(group, error);
  }
  // Space was found, or perhaps a large call is in the way of small ones: each for itself.
  for (Task* task : group) {
    Group one{task};
    try {
      attempt(one);
    } catch (const SqlError& error) {
      fail(one, error);
    }
  }
}

void WriteQueue::attempt(Group& group) {
  const auto start = SteadyClock::now();
  if (!ensure_connection())
    throw SqlError(Failure::unavailable, status().trouble ? status().trouble->what() : "closed");
  if (const auto lost = misplaced())
    throw *lost;  // outside of the try: the connection has what is to be saved
  std::size_t rows = 0;
  try {
    Query(*connection_, "BEGIN IMMEDIATE").run();
    for (Task* task : group) {
      run_task(*task);
      if (!task->error) rows += task->rows;
    }
    Query(*connection_, "COMMIT").run();
  } catch (const SqlError& error) {
    // After a failed write or fsync the pages in memory are not to be believed: close, and let a new
    // connection recover.
    if (!rolled_back_whole() || error.failure() != Failure::full) connection_.reset();
    throw;
  }
  if (!wal_) wal_.emplace(file_.string() + "-wal");
  if (const auto lost = misplaced()) throw *lost;  // stored, where nobody finds it: not acknowledged
  auto shared = shared_.lock();
  ++shared->status.commits;
  shared->status.rows += rows;
  shared->status.last_commit_s = std::chrono::duration<double>(SteadyClock::now() - start).count();
  shared->status.trouble.reset();
}

void WriteQueue::note(const std::optional<SqlError>& trouble) {
  auto shared = shared_.lock();
  shared->status.trouble = trouble;
}

void WriteQueue::run_task(Task& task) {
  task.error.reset();
  Query(*connection_, "SAVEPOINT call").run();
  try {
    task.error = (*task.work)(*connection_);
  } catch (const SqlError& error) {
    if (error.failure() != Failure::constraint && error.failure() != Failure::internal) throw;
    task.error = to_error(error);
  } catch (const std::exception& error) {
    task.error = make_error(Errc::internal, std::string("storage: ") + error.what());
  }
  if (task.error) Query(*connection_, "ROLLBACK TO call").run();
  Query(*connection_, "RELEASE call").run();
}

bool WriteQueue::rolled_back_whole() noexcept {
  try {
    if (connection_->in_transaction()) connection_->execute("ROLLBACK");
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

void WriteQueue::fail(Group& group, const SqlError& error) {
  for (Task* task : group) task->error = to_error(error);
  note(error);
}

bool WriteQueue::ensure_connection() {
  if (connection_ != nullptr) return true;
  const auto now = SteadyClock::now();
  if (now < next_reopen_) return false;
  next_reopen_ = now + k_write_queue_reopen_every;
  try {
    auto connection = open_();
    // A connection opened while the disk was read-only stays so for ever.
    if (connection->read_only_file()) throw SqlError(Failure::unavailable, "database: the file is read-only");
    wal_.reset();
    if (const auto lost = misplaced()) throw *lost;
    connection_ = std::move(connection);
    note(std::nullopt);
    return true;
  } catch (const SqlError& error) {
    note(error);
    return false;
  }
}

/// What is wrong where a name leads to another file than the one that is open, or to none.
std::optional<SqlError> WriteQueue::misplaced() {
  const bool database = !database_.holds();
  if (!database && (!wal_ || wal_->holds())) return std::nullopt;
  const std::string name = file_.filename().string() + (database ? "" : "-wal");
  return SqlError(Failure::unavailable,
                  "database: " + name +
                      " was removed, renamed or replaced while it is in use: nothing is "
                      "stored until the same file is back" +
                      saved_);
}

/// Seen also when nobody writes; a file that is back in its place is taken again.
void WriteQueue::watch_place() {
  if (connection_ == nullptr) return;
  if (!misplaced()) {
    if (!std::exchange(saved_, "").empty()) note(std::nullopt);
    next_save_ = {};
    return;
  }
  const auto now = SteadyClock::now();
  if (now >= next_save_) {
    const auto copy = save_beside(*connection_, file_);
    saved_ =
        copy ? ". All that was stored is in " + copy.value().filename().string() +
                   " beside it: stop anchord, rename that copy to the name of the database, start it again"
             : ". Do not stop anchord: no copy of what was stored could be made (" + copy.error().message +
                   ")";
    next_save_ = copy ? SteadyClock::time_point::max() : now + k_save_every;
  }
  note(misplaced());
}

void WriteQueue::checkpoint_if(bool due) {
  if (connection_ == nullptr || connection_->wal_pages() == 0) return;
  if (!due && static_cast<std::uint64_t>(connection_->wal_pages()) * k_write_queue_page_bytes <
                  limits_.checkpoint_wal_bytes)
    return;
  try {
    connection_->checkpoint_passive();
  } catch (const SqlError& error) {
    // No acknowledged row is at risk: all are in the WAL. A full disk heals by itself, anything else by
    // reopening.
    if (error.failure() != Failure::full) connection_.reset();
    note(error);
  }
}

}  // namespace anchord::sql
