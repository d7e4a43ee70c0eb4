#include "server/storage/reader_pool.hpp"

#include <chrono>
#include <utility>

namespace anchord::sql {

std::unique_ptr<SqliteConnection> ReaderPool::take() {
  auto readers = readers_.lock();
  const auto free = [this](const Readers& r) { return r.in_use < size_; };
  if (!readers.wait_for(freed_, std::chrono::seconds(5), free)) {
    throw SqlError(Failure::unavailable, "database: all readers were busy for 5 s");
  }
  ++readers->in_use;
  if (readers->idle.empty()) return nullptr;
  auto connection = std::move(readers->idle.back());
  readers->idle.pop_back();
  return connection;
}

void ReaderPool::give_back(std::unique_ptr<SqliteConnection> connection) {
  {
    auto readers = readers_.lock();
    --readers->in_use;
    if (connection != nullptr) readers->idle.push_back(std::move(connection));
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
    Query(*connection, "BEGIN").run();
    error = work(*connection);
    Query(*connection, "COMMIT").run();
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
