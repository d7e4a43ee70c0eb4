#include "server/storage/server_lease.hpp"

#include <thread>
#include <utility>

#include "server/storage/postgres_connection.hpp"
#include "server/storage/postgres_migrate.hpp"

namespace anchord {
namespace {

using sql::PostgresConnection;
using sql::Query;
using sql::SqlError;
using SteadyClock = std::chrono::steady_clock;

/// A database that is gone without a word must be noticed within the lease, or the one that stands by asks a
/// machine that is no longer there while another one has become the primary.
constexpr PostgresConnection::Patience k_patience{"2000", "2"};
constexpr auto k_try_every = std::chrono::milliseconds(500);
/// A standby that was not heard of for this long is none.
constexpr std::int64_t k_heard_ns = 30'000'000'000;

// Read committed: whoever writes meanwhile is neither waited for nor undone by it.
constexpr const char* k_begin_lease =
    "BEGIN ISOLATION LEVEL READ COMMITTED; SET LOCAL statement_timeout = 2000; SET LOCAL lock_timeout = 2000";
constexpr const char* k_take_lease =
    "INSERT INTO server_lease (one, server, fence, lease_t_ns, standby, standby_t_ns) VALUES (1, ?1, 1, "
    "now_ns() + ?2, '', 0) ON CONFLICT (one) DO UPDATE SET server = excluded.server, fence = "
    "server_lease.fence + 1, lease_t_ns = excluded.lease_t_ns, standby = '', standby_t_ns = 0 WHERE "
    "server_lease.lease_t_ns < now_ns() RETURNING fence";
constexpr const char* k_stand_by_lease =
    "UPDATE server_lease SET standby = ?1, standby_t_ns = now_ns() WHERE one = 1 RETURNING server";
constexpr const char* k_lease_holder = "SELECT server FROM server_lease";
constexpr const char* k_any_lease = "SELECT count(*) FROM pg_class WHERE oid = to_regclass('server_lease')";
constexpr const char* k_live_holder =
    "SELECT server FROM server_lease WHERE one = 1 AND lease_t_ns > now_ns()";
constexpr const char* k_renew_lease =
    "UPDATE server_lease SET lease_t_ns = now_ns() + ?2 WHERE one = 1 AND fence = ?1 RETURNING "
    "standby_t_ns > now_ns() - ?3";
constexpr const char* k_give_back_lease =
    "UPDATE server_lease SET lease_t_ns = 0 WHERE one = 1 AND fence = ?1";

// What began before the lease was taken has passed assert_server and could still be committed.
constexpr const char* k_end_under_way =
    "WITH under_way AS MATERIALIZED (SELECT pid FROM pg_stat_activity WHERE datname = current_database() AND "
    "usename = current_user AND application_name = ?1 AND state <> 'idle' AND pid <> pg_backend_pid()) "
    "SELECT count(*) FROM under_way WHERE pg_terminate_backend(pid)";
constexpr auto k_look_again = std::chrono::milliseconds(20);
constexpr auto k_end_within = std::chrono::seconds(5);

std::int64_t ns(std::chrono::milliseconds length) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(length).count();
}

}  // namespace

/// A connection that is opened again after it failed.
class ServerLease::Line {
 public:
  explicit Line(std::string address) : address_(std::move(address)) {}
  /// A transaction. Throws SqlError.
  template <class Act>
  auto run(Act act) {
    if (!connection_) connection_ = std::make_unique<PostgresConnection>(address_, "anchord", k_patience);
    auto connection = std::move(connection_);
    connection->execute(k_begin_lease);
    auto out = act(*connection);
    connection->commit();
    connection_ = std::move(connection);
    return out;
  }

 private:
  const std::string address_;
  std::unique_ptr<PostgresConnection> connection_;
};

namespace {

/// In one column with the name, so that a newer server can say it before it changes the tables.
constexpr std::string_view k_reached_at = " at ";
std::string shown(const LeaseWish& wish) {
  return wish.url.empty() ? wish.server : wish.server + std::string(k_reached_at) + wish.url;
}
void waits(const LeaseWish& wish, std::string_view holder) {
  if (!wish.waits) return;
  const auto at = holder.find(k_reached_at);
  const bool reached = at != std::string_view::npos;
  wish.waits(holder.substr(0, at), reached ? holder.substr(at + k_reached_at.size()) : std::string_view());
}

struct Attempt {
  std::optional<std::int64_t> fence;
  std::optional<Error> refused;
  std::string holder;
};

Attempt attempt(PostgresConnection& c, const LeaseWish& wish) {
  Attempt out;
  // One that cannot use the tables takes no lease, and leaves no mark: the holder would count on it.
  if (const int version = sql::postgres_version(c); wish.newest_schema > 0 && version > wish.newest_schema) {
    out.refused = sql::newer_database(version, wish.newest_schema);
    return out;
  }
  {
    Query take(c, k_take_lease);
    take << shown(wish) << ns(wish.lease);
    out.fence = take.returned();
  }
  if (out.fence) return out;
  Query holder(c, wish.standby ? k_stand_by_lease : k_lease_holder);
  if (wish.standby) holder << wish.server;
  if (holder.step()) out.holder = holder.text();
  return out;
}

std::int64_t end_under_way(PostgresConnection& c) {
  Query query(c, k_end_under_way);
  query << k_server_sessions;
  return query.returned().value_or(0);
}

Error held_by(const std::string& other) {
  return make_error(
      Errc::conflict,
      "server " + other +
          " has this database: stop it, or start this one with --standby, which waits and takes "
          "over when the other one ends");
}

}  // namespace

Result<std::unique_ptr<ServerLease>> ServerLease::take(const std::string& address, LeaseWish wish) {
  // One that was killed has its lease to the end; then a new start need not fail.
  const auto patience = SteadyClock::now() + wish.lease + 2 * k_try_every;
  auto line = std::make_unique<Line>(address);
  std::string named, trouble;
  for (;;) {
    try {
      const auto made = line->run([&](PostgresConnection& c) { return attempt(c, wish); });
      if (made.refused) return *made.refused;
      if (made.fence) {
        for (const auto deadline = SteadyClock::now() + k_end_within; line->run(end_under_way) > 0;) {
          if (SteadyClock::now() > deadline)
            throw SqlError(sql::Failure::unavailable, "sessions of the server before do not end");
          std::this_thread::sleep_for(k_look_again);
        }
        return std::unique_ptr<ServerLease>(new ServerLease(std::move(line), std::move(wish), *made.fence));
      }
      if (!wish.standby && SteadyClock::now() > patience) return held_by(made.holder);
      if (wish.standby && (named != made.holder || !trouble.empty())) waits(wish, named = made.holder);
      trouble.clear();
    } catch (const SqlError& error) {
      const auto why = sql::to_error(error);
      if (!wish.standby || named.empty()) return why;  // else it comes back
      // Each reason once: it is asked twice a second.
      if (wish.cannot && trouble != why.message) wish.cannot(trouble = why.message);
    }
    if (wish.stopping && wish.stopping()) return make_error(Errc::canceled, "stopped while it stood by");
    std::this_thread::sleep_for(k_try_every);
  }
}

ServerLease::ServerLease(std::unique_ptr<Line> line, LeaseWish wish, std::int64_t fence)
    : line_(std::move(line)),
      wish_(std::move(wish)),
      fence_(fence),
      held_(std::in_place, Held{SteadyClock::now()}),
      keeper_("anchord-lease", [this] { keep(); }),
      watch_("anchord-leasewatch", [this] { watch(); }) {}

ServerLease::~ServerLease() {
  {
    auto held = held_.lock();
    held->stopping = true;
  }
  wake_.notify_all();
  keeper_.join();
  watch_.join();
  (void)guarded("server lease", [this] { give_back(); });
}

void ServerLease::keep() {
  for (;;) {
    {
      auto held = held_.lock();
      const auto ended = [](const Held& h) { return h.stopping || h.over; };
      if (held.wait_for(wake_, wish_.lease / 4, ended)) return;
    }
    (void)guarded("server lease", [this] { renew(); });
  }
}

void ServerLease::watch() {
  for (;;) {
    {
      auto held = held_.lock();
      const auto ended = [](const Held& h) { return h.stopping || h.over; };
      if (held.wait_for(wake_, wish_.lease / 20, ended)) return;
      if (!held->stood_by || SteadyClock::now() - held->renewed < wish_.lease * 4 / 5) continue;
    }
    end("the database has been out of reach, and another server stands by, which takes over");
  }
}

void ServerLease::renew() {
  const auto asked = SteadyClock::now();
  std::optional<std::int64_t> stood_by;
  try {
    stood_by = line_->run([&](PostgresConnection& c) {
      Query query(c, k_renew_lease);
      query << fence_ << ns(wish_.lease) << k_heard_ns;
      return query.returned();
    });
  } catch (const SqlError&) {
    return;  // away: watch() counts the time
  }
  if (!stood_by) return end("another server has taken over the database");
  auto held = held_.lock();
  held->renewed = asked;
  held->stood_by = *stood_by != 0;
}

void ServerLease::end(const std::string& why) {
  {
    auto held = held_.lock();
    if (std::exchange(held->over, true)) return;
  }
  wake_.notify_all();
  if (wish_.lost) (void)guarded("server lease", [&] { wish_.lost(why); });
}

void ServerLease::give_back() {
  try {
    line_->run([&](PostgresConnection& c) {
      Query query(c, k_give_back_lease);
      query << fence_;
      query.run();
      return true;
    });
  } catch (const SqlError&) {
    // It ends by itself.
  }
}

std::optional<std::string> sql::serving_server(PostgresConnection& connection) {
  {
    Query any(connection, k_any_lease);
    if (!any.step() || any.integer() == 0) return std::nullopt;
  }
  Query holder(connection, k_live_holder);
  if (!holder.step()) return std::nullopt;
  return holder.text();
}

}  // namespace anchord
