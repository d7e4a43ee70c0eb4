// Servers of two versions on one database, as during an update (docs/postgresql.md): when the tables change,
// and who may still do what. The older program is a lease and a gate that know one step of the tables less.
#include "server/storage/server_lease.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>

#include "core/base/guard.hpp"
#include "core/ports/token_store.hpp"
#include "server/storage/postgres_gate.hpp"
#include "server/storage/postgres_migrate.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::server_lease_test {
namespace {

using sql::PostgresConnection;
using sql::PostgresGate;
using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr auto k_soon = std::chrono::seconds(20);

class PostgresLease : public testing::Test {
 protected:
  void SetUp() override {
    if (!PostgresServer::installed()) GTEST_SKIP() << postgresql_missing();
    name_ = "lease_" + sql::sha256_hex(dir_.path().string()).substr(0, 16);
    postgres_server().execute("CREATE DATABASE " + name_);
    migrate_to(older());
  }
  static int newest() { return newest_schema_version(); }
  static int older() { return newest() - 1; }
  std::string address() const { return postgres_server().address(name_); }
  std::int64_t integer(const std::string& text) const {
    PostgresConnection connection(address());
    sql::Query query(connection, text);
    return query.step() ? query.integer() : -1;
  }
  int version() const { return static_cast<int>(integer("SELECT max(number) FROM schema_migration")); }
  void migrate_to(int version) const {
    PostgresConnection connection(address());
    const auto steps = postgresql_migrations().first(static_cast<std::size_t>(version));
    ASSERT_TRUE(sql::migrate_postgres(connection, steps, UtcTime{7}));
  }

  LeaseWish wish(const std::string& server, int newest_schema, bool standby,
                 milliseconds lease = milliseconds(5000)) const {
    LeaseWish out;
    out.server = server;
    out.standby = standby;
    out.lease = lease;
    out.newest_schema = newest_schema;
    return out;
  }
  std::unique_ptr<ServerLease> taken(const std::string& server, int newest_schema) const {
    auto lease = ServerLease::take(address(), wish(server, newest_schema, false));
    EXPECT_TRUE(lease) << lease.error().message;
    return lease ? std::move(lease).value() : nullptr;
  }
  /// A write of the server whose lease has this number, or had it.
  std::optional<Error> write(
      std::int64_t fence, const std::function<void()>& in_the_middle = [] {}) const {
    PostgresGate gate([this] { return std::make_unique<PostgresConnection>(address(), k_server_sessions); },
                      {1, 1, 10, 10, std::chrono::seconds(30), fence});
    return gate.write(1, [&](sql::Connection& c) -> std::optional<Error> {
      in_the_middle();
      sql::Query(c,
                 "INSERT INTO token (id, name, secret_sha256_hex, created_t_ns) VALUES "
                 "(uuid_send(gen_random_uuid()), 'of a test', CAST(gen_random_uuid() AS TEXT), 0)")
          .run();
      return std::nullopt;
    });
  }
  Result<std::unique_ptr<Database>> open(const LeaseWish& wish) const {
    PostgresOptions options;
    options.address = address();
    options.data_dir = dir_.path() / "data";
    options.lease = wish;
    return open_postgres(options);
  }
  std::int64_t rows() const { return integer("SELECT count(*) FROM token"); }

  ScratchDir dir_;
  std::string name_;
};

/// What waits for the database in a thread of its own.
template <class T>
class Waiting {
 public:
  using Start = std::function<Result<std::unique_ptr<T>>(const LeaseWish&)>;
  Waiting(Start start, LeaseWish wish) {
    wish.waits = [this](std::string_view, std::string_view) { stands_by_.set_value(); };
    wish.stopping = [this] { return stopping_.load(); };
    thread_ = Thread("waiting", [this, start, wish] { ended_.set_value(start(wish)); });
  }
  ~Waiting() {
    stopping_ = true;
    thread_.join();
  }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;
  bool stands_by() { return stands_by_.get_future().wait_for(k_soon) == std::future_status::ready; }
  /// How the start ended; canceled where it did not within k_soon.
  Result<std::unique_ptr<T>> ended() {
    auto future = ended_.get_future();
    if (future.wait_for(k_soon) != std::future_status::ready) stopping_ = true;
    return future.get();
  }

 private:
  std::promise<void> stands_by_;
  std::promise<Result<std::unique_ptr<T>>> ended_;
  std::atomic<bool> stopping_{false};
  Thread thread_;
};

TEST_F(PostgresLease, ANewerProgramChangesTheTablesWhenTheOlderOneEndsAndNotBefore) {
  auto holder = taken("older", older());
  ASSERT_NE(holder, nullptr);
  ASSERT_FALSE(write(holder->fence()));
  Waiting<Database> newer([this](const LeaseWish& w) { return open(w); }, wish("newer", newest(), true));
  ASSERT_TRUE(newer.stands_by());
  EXPECT_EQ(version(), older());
  EXPECT_FALSE(write(holder->fence())) << "a program that waits is in nobody's way";
  EXPECT_EQ(rows(), 2);

  holder.reset();  // stopped, as the update says
  const auto db = opened_or_told(newer.ended());
  ASSERT_NE(db, nullptr);
  EXPECT_EQ(version(), newest());
  EXPECT_EQ(rows(), 2);
  EXPECT_EQ(db->stores().tokens.tokens().value().size(), 2u);
}

TEST_F(PostgresLease, AnOlderProgramThatWasTakenOverFromStoresNothingInTheNewerTables) {
  // Its machine was suspended: the lease ran out without its knowing, and it comes back.
  constexpr std::int64_t k_suspended = 7;
  PostgresConnection(address()).execute(
      "INSERT INTO server_lease (one, server, fence, lease_t_ns, standby, standby_t_ns) VALUES "
      "(1, 'older', 7, 1, '', 0)");
  ASSERT_FALSE(write(k_suspended));
  const auto db = opened_or_told(open(wish("newer", newest(), true)));
  ASSERT_NE(db, nullptr);
  EXPECT_EQ(version(), newest());
  const auto refused = write(k_suspended);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, Errc::storage_unavailable);
  EXPECT_THAT(refused->message, HasSubstr("another server has taken over this database"));
  EXPECT_EQ(rows(), 1);
}

TEST_F(PostgresLease, AWriteThatWasUnderWayWhenItsServerWasTakenOverFromIsUndone) {
  // Suspended in the middle of a transaction whose fence was right when it began.
  PostgresConnection(address()).execute(
      "INSERT INTO server_lease (one, server, fence, lease_t_ns, standby, standby_t_ns) VALUES "
      "(1, 'suspended', 7, 1, '', 0)");
  std::unique_ptr<ServerLease> next;
  const auto undone = write(7, [&] { next = taken("next", newest()); });
  ASSERT_NE(next, nullptr);
  ASSERT_TRUE(undone);
  EXPECT_EQ(undone->code, Errc::storage_unavailable);
  EXPECT_EQ(rows(), 0);
  EXPECT_FALSE(write(next->fence()));
}

TEST_F(PostgresLease, ATakeOverCutsOffNobodyElse) {
  PostgresConnection reader(address());
  reader.execute("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY; SELECT count(*) FROM token");
  const auto next = taken("next", newest());
  ASSERT_NE(next, nullptr);
  reader.execute("SELECT count(*) FROM token; COMMIT");
  EXPECT_TRUE(reader.usable());
}

TEST_F(PostgresLease, AnOlderProgramIsRefusedWhereTheTablesAreNewerAndIsNotCountedAsAStandby) {
  migrate_to(newest());
  const auto holder = taken("newer", newest());
  for (const bool standby : {true, false}) {
    const auto refused = ServerLease::take(address(), wish("older", older(), standby));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::unsupported);
    EXPECT_THAT(refused.error().message, HasSubstr("Use the newer anchord"));
  }
  // The holder would end with a database that is away, for the sake of one that cannot take over.
  EXPECT_EQ(look_at_postgres(address()).value().standby, "");
  EXPECT_FALSE(write(holder->fence()));
}

TEST_F(PostgresLease, AnOlderProgramThatIsNotOfTheseTablesTakesNoLeaseFromThem) {
  migrate_to(newest());
  const auto refused = ServerLease::take(address(), wish("older", older(), true));
  ASSERT_FALSE(refused);
  EXPECT_EQ(integer("SELECT count(*) FROM server_lease"), 0);
}

TEST_F(PostgresLease, AnOlderProgramThatWaitsEndsWhenANewerOneChangesTheTables) {
  const auto holder = taken("newer", newest());
  Waiting<ServerLease> waiting([this](const LeaseWish& w) { return ServerLease::take(address(), w); },
                               wish("older", older(), true));
  ASSERT_TRUE(waiting.stands_by());
  migrate_to(newest());
  const auto refused = waiting.ended();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
}

TEST_F(PostgresLease, TellsItsHolderWhetherAnotherServerWaits) {
  ASSERT_NO_FATAL_FAILURE(migrate_to(newest()));
  const auto opened = opened_or_told(open(wish("first", newest(), false)));
  ASSERT_NE(opened, nullptr);
  const auto stood_by = [&] { return opened->health().stood_by; };
  EXPECT_EQ(stood_by(), std::optional(false));
  const auto told = [&](bool wanted) {
    for (int i = 0; i < 400 && stood_by() != std::optional(wanted); ++i)
      std::this_thread::sleep_for(milliseconds(50));
    return stood_by() == std::optional(wanted);
  };
  {
    Waiting<ServerLease> waiting([this](const LeaseWish& w) { return ServerLease::take(address(), w); },
                                 wish("second", newest(), true));
    ASSERT_TRUE(waiting.stands_by());
    EXPECT_TRUE(told(true));
  }
  // Its mark is as old as if it had been silent for 40 s.
  PostgresConnection(address()).execute("UPDATE server_lease SET standby_t_ns = now_ns() - 40000000000");
  EXPECT_TRUE(told(false));
}

TEST_F(PostgresLease, IsKeptWhileTheTablesChangeForLongerThanItLasts) {
  constexpr milliseconds k_lease{500};
  // What a large table takes: the step cannot be recorded before this is over.
  PostgresConnection in_the_way(address());
  in_the_way.execute("BEGIN; LOCK TABLE schema_migration IN EXCLUSIVE MODE");
  Waiting<Database> newer([this](const LeaseWish& w) { return open(w); },
                          wish("newer", newest(), true, k_lease));
  for (int i = 0; i < 400 && integer("SELECT count(*) FROM server_lease") == 0; ++i)
    std::this_thread::sleep_for(milliseconds(50));
  const auto third = ServerLease::take(address(), wish("third", newest(), false, 2 * k_lease));
  ASSERT_FALSE(third) << "it would change the tables a second time";
  EXPECT_EQ(third.error().code, Errc::conflict);
  EXPECT_EQ(version(), older());
  in_the_way.execute("COMMIT");
  EXPECT_NE(opened_or_told(newer.ended()), nullptr);
  EXPECT_EQ(version(), newest());
}

}  // namespace
}  // namespace anchord::server_lease_test
