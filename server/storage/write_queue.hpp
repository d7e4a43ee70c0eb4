#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/file_place.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "server/storage/sql.hpp"
#include "server/storage/sqlite_connection.hpp"
#include "server/storage/sqlite_database.hpp"

namespace anchord::sql {

/// The one writer: a thread with the only read-write connection. What waits when a commit ends goes into the
/// next one together (group commit), each call inside a savepoint of its own. Callers wake after the commit,
/// never before, and only while the database and its log are the files that their names lead to: where they
/// were removed, renamed or replaced, nothing more is stored, and what the open connection still has is
/// copied beside them, once.
class WriteQueue {
 public:
  struct Limits {
    std::size_t max_rows, max_calls;
    std::uint64_t checkpoint_wal_bytes;
  };
  struct Status {
    std::size_t queued_calls{}, queued_rows{};
    std::uint64_t commits{}, rows{};
    double last_commit_s{};
    double oldest_s{};                ///< how long the call that waits longest has waited; 0: none waits
    std::optional<SqlError> trouble;  ///< of the last write; nothing after one that went well
  };
  using Open = std::function<std::unique_ptr<SqliteConnection>()>;

  /// Of disk space, touched by the writer's thread alone.
  struct Reserve {
    std::function<bool()> give_up;  ///< frees space once and says whether it did
    std::function<void()> fill;     ///< when nothing is to be written and the last write went well
  };

  /// `file` is what `connection` has open; `open` makes a new connection to it after a failure.
  WriteQueue(std::unique_ptr<SqliteConnection> connection, std::filesystem::path file, Open open,
             Reserve reserve, Limits limits);
  /// Finishes what is queued, checkpoints, closes.
  ~WriteQueue();

  std::optional<Error> write(std::size_t rows, const Work& work);
  Status status() const;

 private:
  struct Task {
    std::size_t rows{};
    const Work* work{};
    std::optional<Error> error;  ///< of the writer's thread until it is done
    bool done{false};            ///< under the lock of shared_
    std::chrono::steady_clock::time_point since{std::chrono::steady_clock::now()};
  };
  using Group = std::vector<Task*>;
  struct Shared {
    std::deque<Task*> queue;
    std::optional<std::chrono::steady_clock::time_point>
        writing_since;  ///< the oldest of what is written now
    std::size_t queued_rows{0};
    bool stopping{false};
    Status status;
  };

  void run();
  void take(Group& group);
  void commit(Group& group);
  void attempt(Group& group);
  void run_task(Task& task);
  bool rolled_back_whole() noexcept;
  void fail(Group& group, const SqlError& error);
  void note(const std::optional<SqlError>& trouble);
  bool ensure_connection();
  void checkpoint_if(bool due);
  std::optional<SqlError> misplaced();
  void watch_place();

  const std::filesystem::path file_;
  const Open open_;
  const Reserve reserve_;
  const Limits limits_;

  // Of the writer's thread only.
  std::unique_ptr<SqliteConnection> connection_;
  std::chrono::steady_clock::time_point next_reopen_{}, next_save_{};
  const FilePlace database_;
  std::optional<FilePlace> wal_;  ///< since the first commit of this connection
  std::string saved_;             ///< in words, while files are not in their place; empty: not tried yet

  Locked<Shared> shared_;
  std::condition_variable wake_writer_, wake_callers_;

  Thread thread_;
};

}  // namespace anchord::sql
