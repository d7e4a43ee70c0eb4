#include "server/storage/postgres_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>

#include "core/base/guard.hpp"
#include "server/storage/postgres_gate.hpp"
#include "server/storage/postgres_migrate.hpp"
#include "server/storage/row_tables.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::sql::postgres_test {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::UnorderedElementsAreArray;

TEST(PostgresText, CountsParametersAsPostgresDoes) {
  const PostgresText text(
      "SELECT ?2, '?1', \"?1\" FROM t -- ?9\nWHERE a = ?12 AND ifnull(b, ?1) = '' AND notifnull(c)");
  EXPECT_EQ(text.whole(),
            "SELECT $2, '?1', \"?1\" FROM t -- ?9\nWHERE a = $12 AND coalesce(b, $1) = '' AND notifnull(c)");
  EXPECT_EQ(text.parameters(), 12);
}

TEST(PostgresText, PutsNullWhereAParameterHasNoValue) {
  EXPECT_EQ(PostgresText("?1 IS NULL OR a = ?1 OR b = ?2").with({false, true}),
            "NULL IS NULL OR a = NULL OR b = $2");
}

TEST(PostgresText, LeavesAQuestionMarkWithoutANumberAlone) {
  EXPECT_EQ(PostgresText("a ? b ?0 ?99999").whole(), "a ? b ?0 ?99999");
}

TEST(PostgresText, ShowsAnAddressWithoutItsPassword) {
  EXPECT_EQ(shown_address("postgresql://a:secret@host:5432/name?password=secret"),
            "postgresql://host:5432/name");
  EXPECT_EQ(shown_address("postgresql:///name?host=/run"), "postgresql:///name");
  EXPECT_EQ(shown_address("postgresql://a:se?cret@host/name"), "postgresql://...");
  EXPECT_EQ(shown_address("host=x password=secret"), "PostgreSQL");
}

TEST(PostgresText, RefusesAPasswordHoweverItIsSpelt) {
  for (const char* address :
       {"postgresql://a:secret@host/name", "postgresql://host/name?password=secret",
        "postgresql://host/n?pass%77ord=x", "postgresql://host/name?sslmode=require&sslpassword=x",
        "mysql://host/name", "/var/lib/name", ""})
    EXPECT_NE(address_fault(address), "") << address;
  for (const char* address :
       {"postgresql://a@host:5432/name?sslmode=verify-full", "postgres:///name", "postgresql://%41@host/x"})
    EXPECT_EQ(address_fault(address), "") << address;
}

/// A database of its own for each test.
class Postgres : public testing::Test {
 protected:
  void SetUp() override {
    if (!PostgresServer::installed()) GTEST_SKIP() << postgresql_missing();
    name_ = "own_" + sha256_hex(dir_.path().string()).substr(0, 16);
    postgres_server().execute("CREATE DATABASE " + name_);
  }
  std::string address() const { return postgres_server().address(name_); }
  std::unique_ptr<PostgresConnection> connect() const {
    return std::make_unique<PostgresConnection>(address());
  }
  PostgresGate::Limits limits() const { return {4, 4, 1000, 100, std::chrono::seconds(30)}; }
  std::unique_ptr<PostgresGate> gate() const { return gate(limits()); }
  std::unique_ptr<PostgresGate> gate(const PostgresGate::Limits& limits) const {
    return std::make_unique<PostgresGate>([this] { return connect(); }, limits);
  }
  static std::int64_t integer(Connection& c, const std::string& sql) {
    Query query(c, sql);
    return query.step() ? query.integer() : -1;
  }
  Result<void> migrated(std::span<const Migration> migrations = postgresql_migrations()) const {
    const auto c = connect();
    return migrate_postgres(*c, migrations, UtcTime{7});
  }

  ScratchDir dir_;
  std::string name_;
};

Work executes(const std::string& sql) {
  return [sql](Connection& c) -> std::optional<Error> {
    Query(c, sql).run();
    return std::nullopt;
  };
}

TEST_F(Postgres, MigratesOnceAlsoWhenSeveralServersStartTogether) {
  std::atomic<int> went_well{0};
  {
    std::vector<Thread> servers;
    for (int i = 0; i < 4; ++i)
      servers.emplace_back("server", [&] { went_well += migrated().has_value() ? 1 : 0; });
    for (auto& server : servers) server.join();
  }
  EXPECT_EQ(went_well, 4);
  const auto c = connect();
  EXPECT_EQ(integer(*c, "SELECT max(number) FROM schema_migration"), newest_schema_version());
  EXPECT_EQ(integer(*c, "SELECT count(*) FROM schema_migration"), newest_schema_version());
}

TEST_F(Postgres, GoesFromEachVersionToTheNewest) {
  const auto all = postgresql_migrations();
  for (std::size_t version = 1; version <= all.size(); ++version) {
    ASSERT_TRUE(migrated(all.first(version))) << version;
    EXPECT_EQ(integer(*connect(), "SELECT max(number) FROM schema_migration"), static_cast<int>(version));
  }
}

TEST_F(Postgres, HasTheTablesAndColumnsOfSqlite) {
  ASSERT_TRUE(migrated());
  open_sqlite(dir_.path() / "data");
  SqliteConnection sqlite(dir_.path() / "data" / "anchord.db", SqliteConnection::Mode::read_only,
                          Synchronous::full, std::nullopt);
  Query of_sqlite(
      sqlite,
      "SELECT m.name || '.' || p.name FROM sqlite_schema m JOIN pragma_table_info(m.name) p WHERE m.type "
      "= 'table' ORDER BY 1");
  const auto c = connect();
  Query of_postgres(*c,
                    "SELECT CAST(table_name || '.' || column_name AS TEXT) COLLATE \"C\" FROM "
                    "information_schema.columns WHERE table_schema = 'public' ORDER BY 1");
  std::vector<std::string> expected, found;
  while (of_sqlite.step()) expected.push_back(of_sqlite.text());
  while (of_postgres.step()) found.push_back(of_postgres.text());
  EXPECT_EQ(found, expected);
}

TEST_F(Postgres, RefusesADatabaseOfANewerProgram) {
  ASSERT_TRUE(migrated());
  const auto older = postgresql_migrations().first(3);
  const auto refused = migrated(older);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
  EXPECT_THAT(refused.error().message, HasSubstr("supports versions up to 3"));
}

TEST_F(Postgres, RefusesADatabaseThatIsNotOurs) {
  connect()->execute("CREATE TABLE invoices (number BIGINT)");
  const auto refused = migrated();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
  EXPECT_EQ(integer(*connect(), "SELECT count(*) FROM pg_class WHERE relname = 'site'"), 0);
}

TEST_F(Postgres, RefusesAStepThatWasAnotherOne) {
  ASSERT_TRUE(migrated());
  connect()->execute("UPDATE schema_migration SET sha256_hex = 'x' WHERE number = 2");
  const auto refused = migrated();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
}

TEST_F(Postgres, AStepThatFailsLeavesTheVersionBefore) {
  const auto all = postgresql_migrations();
  ASSERT_TRUE(migrated(all.first(2)));
  const std::vector<Migration> broken{
      all[0], all[1], {3, "broken", "CREATE TABLE made (a BIGINT); SELECT nothing;"}};
  EXPECT_THROW((void)migrated(broken), SqlError);
  EXPECT_EQ(integer(*connect(), "SELECT max(number) FROM schema_migration"), 2);
  EXPECT_EQ(integer(*connect(), "SELECT count(*) FROM pg_class WHERE relname = 'made'"), 0);
}

TEST_F(Postgres, LeavesNothingInASession) {
  const auto c = connect();
  c->execute("CREATE TABLE t (a BIGINT)");
  bool looked = false;
  PostgresGate gate([&] { return connect(); }, {1, 1, 10, 10, std::chrono::milliseconds(12'345)});
  ASSERT_FALSE(gate.write(1, executes("INSERT INTO t VALUES (1)")));
  ASSERT_FALSE(gate.write(1, [&](Connection& in) -> std::optional<Error> {
    const auto timeout = [&] {
      Query query(in, "SHOW statement_timeout");
      return query.step() ? query.text() : "";
    };
    EXPECT_EQ(timeout(), "12345ms");
    EXPECT_EQ(integer(in, "SELECT count(*) FROM pg_prepared_statements"), 0);
    in.execute("COMMIT");  // what the session has when the transaction is over
    EXPECT_EQ(timeout(), "0");
    in.execute("BEGIN");
    looked = true;
    return std::nullopt;
  }));
  EXPECT_TRUE(looked);
}

TEST_F(Postgres, AStatementUsedAgainTakesValuesOfOtherTypesAndNone) {
  connect()->execute("CREATE TABLE t (a BIGINT, b TEXT)");
  ASSERT_FALSE(gate()->write(1, [](Connection& c) -> std::optional<Error> {
    Query insert(c, "INSERT INTO t (a, b) VALUES (?1, ?2)");
    for (int i = 0; i < 12; ++i) {
      insert.again();
      insert << (i % 3 == 0 ? std::nullopt : std::optional<std::int64_t>(i)) << std::to_string(i);
      insert.run();
      if (i % 5 == 4) Query(c, "SELECT 1").run();
    }
    return std::nullopt;
  }));
  const auto c = connect();
  EXPECT_EQ(integer(*c, "SELECT CAST(sum(a) AS BIGINT) FROM t"), 66 - (0 + 3 + 6 + 9));
  EXPECT_EQ(integer(*c, "SELECT count(*) FROM t WHERE a IS NULL OR CAST(a AS TEXT) = b"), 12);
}

TEST_F(Postgres, AStatementThatTakesTooLongIsUnavailable) {
  const auto slow = gate({1, 1, 10, 10, std::chrono::milliseconds(50)});
  const auto error = slow->read(executes("SELECT pg_sleep(10) IS NULL"));
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, Errc::storage_unavailable);
}

TEST_F(Postgres, AReadWritesNothing) {
  connect()->execute("CREATE TABLE t (a BIGINT)");
  const auto error = gate()->read(executes("INSERT INTO t VALUES (1)"));
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, Errc::storage_unavailable);
  EXPECT_EQ(integer(*connect(), "SELECT count(*) FROM t"), 0);
}

TEST_F(Postgres, WorkThatAnswersAnErrorWritesNothing) {
  connect()->execute("CREATE TABLE t (a BIGINT)");
  const auto g = gate();
  const auto error = g->write(1, [](Connection& c) -> std::optional<Error> {
    Query(c, "INSERT INTO t VALUES (1)").run();
    return make_error(Errc::conflict, "no");
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, Errc::conflict);
  EXPECT_EQ(integer(*connect(), "SELECT count(*) FROM t"), 0);
}

TEST_F(Postgres, WorkThatHidesAFailureIsNotTakenForCommitted) {
  connect()->execute("CREATE TABLE t (a BIGINT)");
  const auto error = gate()->write(1, [](Connection& c) -> std::optional<Error> {
    Query(c, "INSERT INTO t VALUES (1)").run();
    EXPECT_THROW(Query(c, "SELECT nothing").run(), SqlError);
    return std::nullopt;
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, Errc::internal);
  EXPECT_EQ(integer(*connect(), "SELECT count(*) FROM t"), 0);
}

TEST_F(Postgres, RepeatsWorkThatAnotherWasInTheWayOf) {
  connect()->execute("CREATE TABLE t (a BIGINT); INSERT INTO t VALUES (0)");
  // As two servers: each reads and writes what it read, which without repeating loses counts or fails.
  const auto here = gate();
  const auto there = gate();
  std::atomic<int> failed{0};
  {
    std::vector<Thread> callers;
    for (int i = 0; i < 4; ++i) {
      callers.emplace_back("caller", [&, i] {
        for (int n = 0; n < 25; ++n) {
          const auto error = (i % 2 == 0 ? here : there)->write(1, [](Connection& c) -> std::optional<Error> {
            const auto a = integer(c, "SELECT a FROM t");
            Query query(c, "UPDATE t SET a = ?1");
            query << a + 1;
            query.run();
            return std::nullopt;
          });
          failed += error ? 1 : 0;
        }
      });
    }
    for (auto& caller : callers) caller.join();
  }
  EXPECT_EQ(integer(*connect(), "SELECT a FROM t"), 100 - failed);
  EXPECT_EQ(failed, 0);
  EXPECT_GT(here->status().repeats + there->status().repeats, 0u);
}

/// A mission of three ranges, the first with an impulse response, and a fix.
constexpr const char* k_made_mission =
    "INSERT INTO mission (mission_key, id, name, kit, radio, frame, track_point, state, created_t_ns) VALUES "
    "(1, decode(repeat('01', 16), 'hex'), 'made', '', '', 0, 0, 0, 0); "
    "INSERT INTO uwb_range (range_id, mission_key, kind, t_ns, tag, antenna, anchor, distance_m) "
    "SELECT n, 1, 0, n, 1, 0, 2, 5 FROM generate_series(1, 3) AS n; "
    "INSERT INTO cir (range_id, dt_ps, re_im) VALUES (1, 0, decode('00000000', 'hex')); "
    "INSERT INTO fix (mission_key, t_ns, frame, fix_class) VALUES (1, 1, 0, 4)";
constexpr const char* k_rows_of_missions =
    "SELECT (SELECT count(*) FROM uwb_range) + (SELECT count(*) FROM cir) + (SELECT count(*) FROM fix)";

TEST_F(Postgres, RowsGoWithTheirMission) {
  ASSERT_TRUE(migrated());
  const auto c = connect();
  c->execute(k_made_mission);
  ASSERT_EQ(integer(*c, k_rows_of_missions), 5);
  c->execute("DELETE FROM mission");
  EXPECT_EQ(integer(*c, k_rows_of_missions), 0);
}

// No foreign key is looked up with each row: transactions see that one of the two was in the way.
TEST_F(Postgres, ARowIsNotStoredBesideTheDeletionOfItsMission) {
  ASSERT_TRUE(migrated());
  connect()->execute(k_made_mission);
  const auto appends = gate(), removes = gate();
  int tries = 0;
  const auto error = appends->write(1, [&](Connection& c) -> std::optional<Error> {
    if (integer(c, "SELECT mission_key FROM mission WHERE mission_key = 1") != 1)
      return make_error(Errc::not_found, "the mission is gone");
    if (++tries == 1) {
      EXPECT_FALSE(removes->write(1, executes("DELETE FROM mission WHERE mission_key = 1")));
    }
    Query(c,
          "INSERT INTO uwb_range (mission_key, kind, t_ns, tag, antenna, anchor, distance_m) VALUES (1, 0, "
          "9, 1, 0, "
          "2, 5)")
        .run();
    return std::nullopt;
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, Errc::not_found);
  EXPECT_EQ(tries, 1);
  EXPECT_EQ(integer(*connect(), k_rows_of_missions), 0);
}

TEST_F(Postgres, RefusesWhatIsMoreThanMayWait) {
  const auto g = gate({1, 1, 10, 1, std::chrono::seconds(30)});
  std::optional<Error> inner;
  ASSERT_FALSE(g->write(1, [&](Connection&) -> std::optional<Error> {
    inner = g->write(1, executes("SELECT 1"));
    return std::nullopt;
  }));
  ASSERT_TRUE(inner);
  EXPECT_EQ(inner->code, Errc::queue_full);
}

TEST_F(Postgres, BytesThatAreNoTextAreTheCallersFault) {
  const auto error = gate()->read([](Connection& c) -> std::optional<Error> {
    Query query(c, "SELECT ?1");
    query << std::string_view("\xff\xfe");
    query.run();
    return std::nullopt;
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, Errc::conflict);
}

TEST_F(Postgres, AnAddressThatDoesNotAnswerIsUnavailable) {
  PostgresOptions options;
  options.data_dir = dir_.path();
  options.address = "postgresql://anchord@/absent?host=/nowhere";
  const auto refused = open_postgres(options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::storage_unavailable);
}

TEST_F(Postgres, AnAddressWithAPasswordOrOfAnotherDatabaseIsRefusedWithoutShowingIt) {
  PostgresOptions options;
  options.data_dir = dir_.path();
  for (const char* address :
       {"postgresql://anchord:secret@host/name", "postgresql://host/name?user=anchord&password=secret",
        "postgres://anchord:se?cret@host/name", "mysql://anchord:secret@host/name",
        "host=host password=secret", ""}) {
    options.address = address;
    const auto refused = open_postgres(options);
    ASSERT_FALSE(refused) << address;
    EXPECT_EQ(refused.error().code, Errc::invalid_argument) << address;
    EXPECT_THAT(refused.error().message, Not(HasSubstr("cret"))) << address;
  }
}

TEST_F(Postgres, AFolderWithRowsOfItsOwnDoesNotBeginAnEmptyDatabaseBeside) {
  open_sqlite(dir_.path() / "data");
  PostgresOptions options;
  options.address = address();
  options.data_dir = dir_.path() / "data";
  const auto refused = open_postgres(options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
  EXPECT_THAT(refused.error().message, HasSubstr("anchord database copy"));
}

TEST_F(Postgres, AFolderWhoseRowsAreInPostgresDoesNotBeginAFileBeside) {
  PostgresOptions options;
  options.address = address();
  options.data_dir = dir_.path() / "data";
  ASSERT_TRUE(open_postgres(options));
  StorageOptions without;
  without.data_dir = options.data_dir;
  const auto refused = open_database(without);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
  EXPECT_FALSE(std::filesystem::exists(options.data_dir / "anchord.db"));
  EXPECT_TRUE(open_postgres(options));
}

TEST_F(Postgres, TablesComeAfterThoseTheyName) {
  std::vector<std::string> names;
  for (const auto& table : row_tables()) names.push_back(table.name);
  const auto place = [&](const char* name) { return std::ranges::find(names, name) - names.begin(); };
  EXPECT_LT(place("site"), place("mission"));
  EXPECT_LT(place("mission"), place("uwb_range"));
  EXPECT_LT(place("uwb_range"), place("cir"));
  ASSERT_TRUE(migrated());
  const auto c = connect();
  // All but those that are of the database itself.
  names.insert(names.end(), {"schema_migration", "server_lease"});
  std::vector<std::string> there;
  Query tables(*c, "SELECT CAST(tablename AS TEXT) FROM pg_tables WHERE schemaname = 'public'");
  while (tables.step()) there.push_back(tables.text());
  EXPECT_THAT(names, UnorderedElementsAreArray(there));
}

/// A server of its own, which is stopped and started.
TEST(PostgresOutage, IsUnavailableWhileItLastsAndOverByItself) {
  if (!PostgresServer::installed()) GTEST_SKIP() << postgresql_missing();
  PostgresServer server;
  PostgresOptions options;
  options.address = server.address("postgres");
  const ScratchDir dir;
  options.data_dir = dir.path();
  const auto db = open_postgres(options).value();
  Mission mission;
  mission.id = MissionId{make_uuid_v7(k_noon)};
  mission.created = k_noon;
  ASSERT_TRUE(db->stores().missions.insert(mission));

  server.end(SIGQUIT);
  Mission other = mission;
  other.id = MissionId{make_uuid_v7(k_noon)};
  EXPECT_EQ(db->stores().missions.insert(other).error().code, Errc::storage_unavailable);
  EXPECT_EQ(db->stores().missions.mission(mission.id).error().code, Errc::storage_unavailable);
  EXPECT_FALSE(db->health().writable());

  server.begin();
  for (int i = 0; i < 200 && !db->health().writable(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_TRUE(db->health().writable()) << db->health().reason;
  EXPECT_EQ(db->stores().missions.mission(mission.id).value().id, mission.id);
  EXPECT_EQ(db->stores().missions.mission(other.id).error().code, Errc::not_found);
}

/// A server that hangs breaks no connection: nothing but time tells of it, as with a disk (StorageFailure).
TEST(PostgresOutage, IsStalledWhileTheServerAnswersNothingAndLosesNothing) {
  if (!PostgresServer::installed()) GTEST_SKIP() << postgresql_missing();
  PostgresServer server;
  PostgresOptions options;
  options.address = server.address("postgres");
  const ScratchDir dir;
  options.data_dir = dir.path();
  const auto db = open_postgres(options).value();
  const auto until = [&](StorageLevel level) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (db->health().level != level && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return db->health().level == level;
  };
  Mission mission;
  mission.id = MissionId{make_uuid_v7(k_noon)};
  mission.created = k_noon;
  ASSERT_TRUE(db->stores().missions.insert(mission));
  EXPECT_TRUE(until(StorageLevel::ok));

  server.signal_all(SIGSTOP);
  EXPECT_TRUE(until(StorageLevel::stalled)) << "although nobody writes";
  EXPECT_THAT(db->health().reason, HasSubstr("has not taken a write for"));
  Mission other = mission;
  other.id = MissionId{make_uuid_v7(k_noon)};
  std::atomic<bool> stored{false};
  Thread writer("writer", [&] { stored = db->stores().missions.insert(other).has_value(); });
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_FALSE(stored) << "what is not in the database is not acknowledged";
  EXPECT_TRUE(db->health().writable()) << "stalled, and nothing has failed";

  server.signal_all(SIGCONT);
  writer.join();
  EXPECT_TRUE(stored);
  EXPECT_TRUE(until(StorageLevel::ok)) << db->health().reason;
  EXPECT_EQ(db->stores().missions.mission(other.id).value().id, other.id);
}

/// PostgreSQL reports a commit also where its wait for the synchronous standby was canceled. Were that, or
/// the row that is there from then on, acknowledged, it would be lost with a failover to that standby.
TEST(PostgresStandby, WhatItHasNotConfirmedIsNotAcknowledgedNorIsItsRepetition) {
  if (!PostgresServer::installed()) GTEST_SKIP() << postgresql_missing();
  PostgresServer server;
  PostgresOptions options;
  options.address = server.address("postgres");
  const ScratchDir dir;
  options.data_dir = dir.path();
  const auto db = open_postgres(options).value();
  Mission mission;
  mission.id = MissionId{make_uuid_v7(k_noon)};
  mission.created = k_noon;
  ASSERT_TRUE(db->stores().missions.insert(mission));
  const auto appended = [&] {
    return db->stores().measurements.append_ranges({range_at(mission.id, 1)}, false);
  };
  server.execute("ALTER SYSTEM SET synchronous_standby_names = 'one_that_is_away'");
  server.end(SIGINT);
  server.begin();
  PostgresConnection beside(server.address("postgres"));
  /// How often a commit was waiting for the standby, and was canceled.
  const auto canceled = [&] {
    Query query(
        beside,
        "SELECT count(*) FROM (SELECT pid FROM pg_stat_activity WHERE wait_event = 'SyncRep' OFFSET 0) w "
        "WHERE pg_cancel_backend(w.pid)");
    return query.step() ? query.integer() : 0;
  };

  for (const char* what : {"a row", "the same again, which is there by now", "and again"}) {
    // Until it has waited: a moment after the restart nothing is sent yet.
    for (std::int64_t waited = 0; waited == 0;) {
      auto answer = std::async(std::launch::async, appended);
      while (answer.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready)
        waited += canceled();
      const auto got = answer.get();
      ASSERT_FALSE(got) << what;
      EXPECT_EQ(got.error().code, Errc::storage_unavailable) << what;
    }
  }

  server.execute("ALTER SYSTEM RESET synchronous_standby_names");
  server.execute("SELECT pg_reload_conf()");
  const auto answer = appended();
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer.value().front(), RowOutcome::duplicate);
}

TEST(PostgresOutage, ARestartBetweenTwoCallsIsNotNoticed) {
  if (!PostgresServer::installed()) GTEST_SKIP() << postgresql_missing();
  PostgresServer server;
  PostgresGate gate([&] { return std::make_unique<PostgresConnection>(server.address("postgres")); },
                    {4, 4, 100, 100, std::chrono::seconds(30)});
  ASSERT_FALSE(gate.write(1, executes("CREATE TABLE t (a BIGINT)")));
  ASSERT_FALSE(gate.read(executes("SELECT a FROM t")));
  server.end(SIGINT);
  server.begin();
  EXPECT_FALSE(gate.read(executes("SELECT a FROM t")));
  EXPECT_FALSE(gate.write(1, executes("INSERT INTO t VALUES (1)")));
}

}  // namespace
}  // namespace anchord::sql::postgres_test
