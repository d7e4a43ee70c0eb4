// Work that several processes claim, on a real PostgreSQL: each store here stands for a process, with
// connections of its own.
#include "server/storage/work_store.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <set>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/ports/job_store.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::work_store_test {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr auto k_short = milliseconds(300);

class PostgresWork : public testing::Test {
 protected:
  void SetUp() override {
    if (!PostgresServer::installed()) GTEST_SKIP() << postgresql_missing();
    name_ = "work_" + sql::sha256_hex(dir_.path().string()).substr(0, 16);
    postgres_server().execute("CREATE DATABASE " + name_);
    PostgresOptions options;
    options.address = address();
    options.data_dir = dir_.path() / "data";
    db_ = opened_or_told(open_postgres(options));
    ASSERT_NE(db_, nullptr);
    server_ = db_->work();
    ASSERT_NE(server_, nullptr);
    first_ = process();
    second_ = process();
  }
  std::string address() const { return postgres_server().address(name_); }
  std::unique_ptr<WorkStore> process() const {
    auto opened = open_work(address());
    EXPECT_TRUE(opened) << opened.error().message;
    return std::move(opened).value();
  }
  JobId offer(const std::string& message = "m", int max_attempts = 3, const std::string& version = "1",
              const std::string& kind = "training") {
    Job job;
    job.id = JobId{make_uuid_v7(UtcTime{k_noon.ns + n_++})};
    job.kind = kind;
    job.created = k_noon;
    EXPECT_TRUE(db_->stores().jobs.insert(job));
    EXPECT_TRUE(server_->offer({job.id, kind, version, message, max_attempts}));
    return job.id;
  }
  static WorkStore::Wish wish(const std::string& worker, milliseconds lease = std::chrono::seconds(60)) {
    return {worker, "1", lease, milliseconds(0)};
  }
  WorkStatus status() const {
    const auto all = server_->all().value();
    EXPECT_EQ(all.size(), 1u);
    return all.empty() ? WorkStatus{} : all.front();
  }
  /// By the database's clock, which is what leases are of.
  void pass(milliseconds time) const {
    sql::PostgresConnection(address()).execute(
        "SELECT pg_sleep(" + std::to_string(static_cast<double>(time.count()) / 1000) + ")");
  }

  ScratchDir dir_;
  std::string name_;
  std::unique_ptr<Database> db_;
  WorkStore* server_{nullptr};
  std::unique_ptr<WorkStore> first_, second_;
  std::int64_t n_{0};
};

TEST_F(PostgresWork, GivesTheOldestToWhoAsksAndTheSameToNobodyElse) {
  const auto a = offer("a"), b = offer("b");
  const auto one = first_->claim(wish("w1")).value(), two = second_->claim(wish("w2")).value();
  ASSERT_TRUE(one && two);
  EXPECT_EQ(one->job, a);
  EXPECT_EQ(one->message, "a");
  EXPECT_EQ(one->attempt, 1);
  EXPECT_EQ(two->job, b);
  EXPECT_FALSE(first_->claim(wish("w1")).value());
}

TEST_F(PostgresWork, GivesOfOneKindAloneToWhoAsksForThat) {
  const auto older = offer("older", 3, "1", "training"), newer = offer("newer", 3, "1", "calibration");
  auto of_kind = wish("w1");
  of_kind.kind = "calibration";
  EXPECT_EQ(first_->claim(of_kind).value()->job, newer);
  EXPECT_FALSE(first_->claim(of_kind).value());
  of_kind.kind = "";
  EXPECT_EQ(first_->claim(of_kind).value()->job, older);
}

TEST_F(PostgresWork, AResultLongerThanAnyIsNotRead) {
  const auto job = offer();
  ASSERT_TRUE(first_->claim(wish("w1")).value());
  sql::PostgresConnection(address()).execute("UPDATE work SET state = 2, result = repeat('x', 536870913)");
  const auto outcome = server_->outcome(job);
  ASSERT_TRUE(outcome) << outcome.error().message;
  ASSERT_TRUE(outcome.value().error);
  EXPECT_THAT(outcome.value().error->message, HasSubstr("536870913 bytes; 536870912 are allowed"));
}

TEST_F(PostgresWork, TwentyWorksAmongEightWhoAskAtOnceAreGivenOnceEach) {
  std::set<std::string> expected;
  for (int i = 0; i < 20; ++i) expected.insert(to_string(offer()));
  Locked<std::vector<std::string>> claimed;
  {
    std::vector<Thread> workers;
    for (int i = 0; i < 8; ++i)
      workers.emplace_back("worker", [&, i] {
        const auto mine = process();
        while (true) {
          const auto claim = mine->claim(wish("w" + std::to_string(i)));
          ASSERT_TRUE(claim) << claim.error().message;
          if (!claim.value()) return;
          auto all = claimed.lock();
          all->push_back(to_string(claim.value()->job));
        }
      });
    for (auto& worker : workers) worker.join();
  }
  const auto all = claimed.copy();
  EXPECT_EQ(all.size(), 20u);
  EXPECT_EQ(std::set<std::string>(all.begin(), all.end()), expected);
}

TEST_F(PostgresWork, KeepsTheResultOfWhoHasTheClaim) {
  const auto job = offer();
  const auto claim = first_->claim(wish("w1")).value();
  ASSERT_TRUE(claim);
  EXPECT_FALSE(first_->beat(*claim, {milliseconds(60'000), 0.25, "search", "fold 1"}).value());
  const auto during = status();
  EXPECT_EQ(during.state, WorkState::claimed);
  EXPECT_EQ(during.worker, "w1");
  EXPECT_EQ(during.fraction, 0.25);
  EXPECT_EQ(during.stage, "search");
  EXPECT_EQ(server_->outcome(job).error().code, Errc::conflict);
  ASSERT_TRUE(first_->finish(*claim, "{\"bytes\":\"ä\"}"));
  const auto outcome = server_->outcome(job).value();
  EXPECT_FALSE(outcome.error);
  EXPECT_EQ(outcome.result, "{\"bytes\":\"ä\"}");
  EXPECT_EQ(first_->finish(*claim, "again").error().code, Errc::conflict);
  ASSERT_TRUE(server_->remove(job));
  EXPECT_TRUE(server_->all().value().empty());
}

TEST_F(PostgresWork, AWorkerThatWasThoughtDeadAndComesBackCanStoreNothing) {
  const auto job = offer();
  const auto late = first_->claim(wish("late", k_short)).value();
  ASSERT_TRUE(late);
  EXPECT_FALSE(second_->claim(wish("other")).value()) << "the lease has not run out";
  pass(k_short + milliseconds(50));
  const auto other = second_->claim(wish("other")).value();
  ASSERT_TRUE(other);
  EXPECT_EQ(other->attempt, 2);
  EXPECT_GT(other->fence, late->fence);
  EXPECT_THAT(status().fault, HasSubstr("worker late no longer answered"));
  for (const auto& refused : {first_->finish(*late, "stale"), first_->fail(*late, {Errc::internal, "stale"}),
                              first_->retry(*late, {Errc::link_lost, "stale"}), first_->give_back(*late)}) {
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::conflict);
  }
  EXPECT_EQ(first_->beat(*late, {}).error().code, Errc::conflict);
  ASSERT_TRUE(second_->finish(*other, "fresh"));
  EXPECT_EQ(first_->finish(*late, "stale").error().code, Errc::conflict);
  EXPECT_EQ(server_->outcome(job).value().result, "fresh");
}

TEST_F(PostgresWork, AClaimWhoseTimeIsOverStandsAsLongAsNobodyElseTookIt) {
  offer();
  const auto claim = first_->claim(wish("w1", k_short)).value();
  ASSERT_TRUE(claim);
  pass(k_short + milliseconds(50));
  EXPECT_TRUE(first_->beat(*claim, {milliseconds(60'000), 0.5, "search", ""}));
  EXPECT_FALSE(second_->claim(wish("w2")).value()) << "renewed";
  EXPECT_TRUE(first_->finish(*claim, "r"));
}

TEST_F(PostgresWork, AJobThatIsOfferedAnewNeverMeetsTheFenceOfItsFormerLife) {
  const auto job = offer();
  const auto before = first_->claim(wish("w1")).value();
  ASSERT_TRUE(before);
  ASSERT_TRUE(server_->offer({job, "training", "1", "anew", 3}));
  const auto now = second_->claim(wish("w2")).value();
  ASSERT_TRUE(now);
  EXPECT_EQ(now->message, "anew");
  EXPECT_GT(now->fence, before->fence);
  EXPECT_EQ(first_->finish(*before, "stale").error().code, Errc::conflict);
  // What was taken in of the old one does not remove the new one.
  ASSERT_TRUE(server_->remove(job, before->fence));
  EXPECT_EQ(server_->all().value().size(), 1u);
}

TEST_F(PostgresWork, TheLastAttemptThatVanishesEndsTheWorkWithCauseAndAdvice) {
  const auto job = offer("m", 2);
  for (int attempt = 1; attempt <= 2; ++attempt) {
    const auto claim = first_->claim(wish("w" + std::to_string(attempt), k_short)).value();
    ASSERT_TRUE(claim) << attempt;
    EXPECT_EQ(claim->attempt, attempt);
    ASSERT_TRUE(server_->end_hopeless());
    EXPECT_EQ(status().state, WorkState::claimed) << "its lease still runs";
    pass(k_short + milliseconds(50));
  }
  EXPECT_FALSE(second_->claim(wish("w3")).value()) << "no attempt is left";
  ASSERT_TRUE(server_->end_hopeless());
  const auto outcome = server_->outcome(job).value();
  ASSERT_TRUE(outcome.error);
  EXPECT_EQ(outcome.error->code, Errc::link_lost);
  EXPECT_THAT(outcome.error->message, HasSubstr("worker w2 no longer answers; 2 attempts were begun"));
}

TEST_F(PostgresWork, AnAttemptThatFailsByItsMachineIsMadeAgainAndTheLastOneIsTheAnswer) {
  const auto job = offer("m", 2);
  auto claim = first_->claim(wish("w1")).value();
  ASSERT_TRUE(claim);
  ASSERT_TRUE(first_->retry(*claim, {Errc::link_lost, "killed by signal 9"}));
  EXPECT_EQ(status().state, WorkState::open);
  EXPECT_EQ(status().fault, "killed by signal 9");
  claim = second_->claim(wish("w2")).value();
  ASSERT_TRUE(claim);
  EXPECT_EQ(claim->attempt, 2);
  ASSERT_TRUE(second_->retry(*claim, {Errc::link_lost, "killed by signal 9"}));
  const auto outcome = server_->outcome(job).value();
  ASSERT_TRUE(outcome.error);
  EXPECT_EQ(outcome.error->code, Errc::link_lost);
  EXPECT_THAT(outcome.error->message, HasSubstr("attempt 2, the last one"));
}

TEST_F(PostgresWork, WhatIsGivenBackWaitsAgainAndHasUsedNoAttempt) {
  offer("m", 1);
  const auto claim = first_->claim(wish("w1")).value();
  ASSERT_TRUE(claim);
  ASSERT_TRUE(first_->give_back(*claim));
  EXPECT_EQ(status().attempts, 0);
  const auto again = second_->claim(wish("w2")).value();
  ASSERT_TRUE(again);
  EXPECT_EQ(again->attempt, 1);
  EXPECT_EQ(first_->finish(*claim, "stale").error().code, Errc::conflict);
}

TEST_F(PostgresWork, CancelEndsWhatWaitsAndTellsWhoWorks) {
  const auto waits = offer();
  EXPECT_TRUE(server_->cancel(waits).value());
  EXPECT_EQ(server_->outcome(waits).value().error->code, Errc::canceled);
  EXPECT_FALSE(first_->claim(wish("w1")).value());
  ASSERT_TRUE(server_->remove(waits));

  const auto runs = offer();
  const auto claim = first_->claim(wish("w1", k_short)).value();
  ASSERT_TRUE(claim);
  EXPECT_TRUE(server_->cancel(runs).value());
  EXPECT_TRUE(first_->beat(*claim, {k_short, 0, "", ""}).value());
  // It dies before it says so: nobody begins it again.
  pass(k_short + milliseconds(50));
  EXPECT_FALSE(second_->claim(wish("w2")).value());
  ASSERT_TRUE(server_->end_hopeless());
  EXPECT_EQ(server_->outcome(runs).value().error->code, Errc::canceled);
  EXPECT_FALSE(server_->cancel(JobId{}).value());
}

TEST_F(PostgresWork, AnotherVersionClaimsNothingAndWhatIsLeftAloneWaits) {
  offer("m", 3, "2");
  EXPECT_FALSE(first_->claim(wish("w1")).value());
  auto patient = wish("w1");
  patient.version = "2";
  patient.left_alone = k_short;
  EXPECT_FALSE(first_->claim(patient).value());
  pass(k_short + milliseconds(50));
  EXPECT_TRUE(first_->claim(patient).value());
}

TEST_F(PostgresWork, ShowsTheWorkersThatAreThereAndWhatTheyDo) {
  ASSERT_TRUE(first_->seen("w1", "1"));
  ASSERT_TRUE(second_->seen("w2", "1"));
  const auto job = offer();
  ASSERT_TRUE(second_->claim(wish("w2")).value());
  auto workers = server_->workers().value();
  ASSERT_EQ(workers.size(), 2u);
  EXPECT_EQ(workers[0].name, "w1");
  EXPECT_FALSE(workers[0].job);
  EXPECT_LT(workers[0].seen_s_ago, 30);
  EXPECT_EQ(workers[1].job, job);
  ASSERT_TRUE(first_->gone("w1"));
  EXPECT_EQ(server_->workers().value().size(), 1u);
}

TEST_F(PostgresWork, OutlivesTheServersStartWhichFailsOnlyWhatNobodyElseHas) {
  const auto out = offer();
  Job own;
  own.id = JobId{make_uuid_v7(k_noon)};
  own.kind = "calibration";
  ASSERT_TRUE(db_->stores().jobs.insert(own));
  EXPECT_EQ(db_->stores().jobs.fail_unfinished(k_noon, {"{}"}).value(), 1u);
  EXPECT_EQ(db_->stores().jobs.job(own.id).value().state, JobState::failed);
  EXPECT_EQ(db_->stores().jobs.job(out).value().state, JobState::queued);
}

// The rights that docs/workers.md names, and no other.
TEST_F(PostgresWork, ARoleWithTheRightsOfTheDocumentCanWorkAndReadNothingElse) {
  const std::string role = "role_" + name_;
  sql::PostgresConnection owner(address());
  owner.execute("CREATE ROLE " + role + " LOGIN; GRANT SELECT ON schema_migration TO " + role +
                "; GRANT SELECT, UPDATE ON work TO " + role +
                "; GRANT SELECT, INSERT, UPDATE, DELETE ON worker TO " + role);
  auto as_role = address();
  as_role.replace(as_role.find("anchord@"), 7, role);
  const auto job = offer();
  auto opened = open_work(as_role);
  ASSERT_TRUE(opened) << opened.error().message;
  auto& work = *opened.value();
  ASSERT_TRUE(work.seen("w", "1"));
  const auto claim = work.claim(wish("w")).value();
  ASSERT_TRUE(claim);
  ASSERT_TRUE(work.beat(*claim, {milliseconds(1000), 0.5, "search", ""}));
  ASSERT_TRUE(work.finish(*claim, "r"));
  ASSERT_TRUE(work.gone("w"));
  EXPECT_EQ(server_->outcome(job).value().result, "r");
  EXPECT_FALSE(work.remove(job));
  sql::PostgresConnection stranger(as_role);
  for (const char* table : {"token", "model", "uwb_range", "dataset_content", "job"})
    EXPECT_THROW(stranger.execute("SELECT * FROM " + std::string(table)), sql::SqlError) << table;
}

TEST_F(PostgresWork, AProgramOfAnotherSchemaIsRefusedWithWhatToDo) {
  sql::PostgresConnection(address()).execute(
      "DELETE FROM schema_migration WHERE number = (SELECT max(number) FROM schema_migration)");
  const auto refused = open_work(address());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
  EXPECT_THAT(refused.error().message, HasSubstr("the server first"));
}

TEST_F(PostgresWork, IsThereAgainAfterARestartOfTheDatabase) {
  const auto job = offer();
  const auto claim = first_->claim(wish("w1")).value();
  ASSERT_TRUE(claim);
  postgres_server().end(SIGINT);
  EXPECT_EQ(first_->finish(*claim, "r").error().code, Errc::storage_unavailable);
  postgres_server().begin();
  pass(milliseconds(600));  // a lost server is tried again every half second
  ASSERT_TRUE(first_->finish(*claim, "r"));
  EXPECT_EQ(server_->outcome(job).value().result, "r");
}

TEST(SqliteWork, IsThereForOneProcessAlone) {
  const ScratchDir dir;
  EXPECT_EQ(open_sqlite(dir.path())->work(), nullptr);
}

}  // namespace
}  // namespace anchord::work_store_test
