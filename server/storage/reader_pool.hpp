#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <vector>

#include "core/base/locked.hpp"
#include "server/storage/sql.hpp"
#include "server/storage/sqlite_connection.hpp"

namespace anchord::sql {

/// A few read-only connections, opened on demand; a caller waits for a free one up to five seconds.
class ReaderPool {
 public:
  using Open = std::function<std::unique_ptr<SqliteConnection>()>;
  ReaderPool(Open open, std::size_t size) : open_(std::move(open)), size_(size) {}

  /// Runs `work` on one snapshot.
  std::optional<Error> read(const Work& work);

 private:
  std::unique_ptr<SqliteConnection> take();
  void give_back(std::unique_ptr<SqliteConnection> connection);

  const Open open_;
  const std::size_t size_;
  struct Readers {
    std::vector<std::unique_ptr<SqliteConnection>> idle;
    std::size_t in_use{0};
  };
  Locked<Readers> readers_;
  std::condition_variable freed_;
};

}  // namespace anchord::sql
