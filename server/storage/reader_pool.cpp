#include "server/storage/reader_pool.hpp"

#include <chrono>
#include <utility>

namespace anchord::sql {

std::unique_ptr<SqliteConnection> ReaderPool::take() {
  std::unique_lock lock(mutex_);
  if (!freed_.wait_for(lock, std::chrono::seconds(5), [&] { return in_use_ < size_; })) {
    throw SqlError(Failure::unavailable, "database: all readers were busy for 5 s");
  }
  ++in_use_;
  if (idle_.empty()) return nullptr;
  auto connection = std::move(idle_.back());
  idle_.pop_back();
  return connection;
}

void ReaderPool::give_back(std::unique_ptr<SqliteConnection> connection) {
  {
    const std::lock_guard lock(mutex_);
    --in_use_;
    if (connection != nullptr) idle_.push_back(std::move(connection));
  }
  freed_.notify_one();
}

std::optional<Error> ReaderPool::read(const Work& work) {
  std::unique_ptr<SqliteConnection> connection;
  std::optional<Error> error;
  try {
    connection = take();
  } catch (const SqlError& busy) {
    return to_error(busy);
  }
  try {
    if (connection == nullptr) connection = open_();
    connection->execute("BEGIN");
    error = work(*connection);
    connection->execute("COMMIT");
  } catch (const SqlError& failed) {
    connection.reset();  // whatever state it is in
    error = to_error(failed);
  } catch (const std::exception& failed) {
    connection.reset();
    error = make_error(Errc::internal, std::string("storage: ") + failed.what());
  }
  give_back(std::move(connection));
  return error;
}

}  // namespace anchord::sql
