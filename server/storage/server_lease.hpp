#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"

namespace anchord {

/// Name of the sessions in which a server with a lease reads and writes.
inline constexpr const char* k_server_sessions = "anchord server";

/// How a server wants to have a PostgreSQL database.
struct LeaseWish {
  std::string server;   ///< its name, for people
  std::string url{};    ///< where other servers reach it; empty: they do not
  bool standby{false};  ///< wait for as long as another one has it
  std::chrono::milliseconds lease{5'000};
  int newest_schema{0};            ///< version of the newest tables that it can use; 0: any
  std::function<bool()> stopping;  ///< asked while it waits
  /// For each that has it while this one waits: its name, and where it is reached.
  std::function<void(std::string_view other, std::string_view url)> waits;
  /// Why it cannot ask for it while it waits, each reason once.
  std::function<void(std::string_view why)> cannot;
  std::function<void(std::string_view why)> lost;  ///< once, from another thread: it must end now
};

/// The right of one server to a PostgreSQL database: a row with a fencing number, renewed by the database's
/// clock. A write that names a number which is no longer that of the row is refused by the database
/// (assert_server), so that a server that stood still and was taken over from stores nothing more. While the
/// database is away the holder goes on; where another server was seen to stand by, only for as long as the
/// lease holds, since that one may have taken over meanwhile.
class ServerLease {
 public:
  /// Returns with the lease. errors  conflict: another server has it, and this one does not stand by;
  /// unsupported: the tables are newer than it can use, from the start or while it waited; canceled:
  /// stopping() while it waited; storage_unavailable
  static Result<std::unique_ptr<ServerLease>> take(const std::string& address, LeaseWish wish);
  /// Gives it back, so that the one that stands by need not wait.
  ~ServerLease();
  ServerLease(const ServerLease&) = delete;
  ServerLease& operator=(const ServerLease&) = delete;

  std::int64_t fence() const { return fence_; }
  /// Whether another server was heard of in the last 30 s that waits to take over.
  bool stood_by() const {
    const auto held = held_.lock();
    return held->stood_by;
  }

 private:
  class Line;
  ServerLease(std::unique_ptr<Line> line, LeaseWish wish, std::int64_t fence);
  struct Held {
    std::chrono::steady_clock::time_point renewed{};
    bool stood_by{false};  ///< another server was seen to wait
    bool over{false};
    bool stopping{false};
  };
  /// Renews it; what is asked of a database that hangs takes seconds.
  void keep();
  /// Notices in time that it was not renewed.
  void watch();
  void renew();
  void end(const std::string& why);
  void give_back();

  const std::unique_ptr<Line> line_;
  const LeaseWish wish_;
  const std::int64_t fence_;
  Locked<Held> held_;
  std::condition_variable wake_;
  Thread keeper_, watch_;
};

namespace sql {
class PostgresConnection;
/// The server that has this database now, as its lease says it: its name, and where it is reached. Nothing
/// where none has it, also where the database is none of anchord or of before there were leases.
std::optional<std::string> serving_server(PostgresConnection& connection);
}  // namespace sql

}  // namespace anchord
