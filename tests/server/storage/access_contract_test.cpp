#include "core/ports/access_store.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/request_mark.hpp"
#include "core/ports/token_store.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::access_contract_test {
namespace {

using testing::ElementsAre;

class AccessContract : public StoreContract {};

TEST_P(AccessContract, FindsATokenBySecretAndKeepsTheFirstRevocation) {
  Token token{TokenId{make_uuid_v7(k_noon)},
              "gate",
              std::string(64, 'a'),
              {"gateway", "viewer"},
              k_noon,
              {},
              {},
              {},
              {},
              {},
              {}};
  ASSERT_TRUE(db_->stores().tokens.insert(token));
  EXPECT_EQ(db_->stores().tokens.insert(token).error().code, Errc::conflict);
  ASSERT_TRUE(db_->stores().tokens.touch(token.id, UtcTime{5}));
  ASSERT_TRUE(db_->stores().tokens.revoke(token.id, UtcTime{7}));
  ASSERT_TRUE(db_->stores().tokens.revoke(token.id, UtcTime{9}));
  const auto found = db_->stores().tokens.token_by_secret(std::string(64, 'a')).value();
  EXPECT_EQ(found.id, token.id);
  EXPECT_THAT(found.roles, ElementsAre("gateway", "viewer"));
  EXPECT_EQ(found.last_used, UtcTime{5});
  EXPECT_EQ(found.revoked, UtcTime{7});
  EXPECT_FALSE(found.expires);
  EXPECT_EQ(db_->stores().tokens.token_by_secret("b").error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().tokens.revoke(TokenId{}, k_noon).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().tokens.tokens().value().size(), 1u);
}

TEST_P(AccessContract, KeepsBrowserSessionsUntilTheyEnd) {
  auto& tokens = db_->stores().tokens;
  const Token token{TokenId{make_uuid_v7(k_noon)},
                    "tablet",
                    std::string(64, 'a'),
                    {"operator"},
                    k_noon,
                    {},
                    {},
                    {},
                    {},
                    {},
                    {}};
  ASSERT_TRUE(tokens.insert(token));
  const BrowserSession late{std::string(64, 'b'), token.id, UtcTime{900}},
      early{std::string(64, 'c'), token.id, UtcTime{500}},
      after{std::string(64, 'd'), token.id, UtcTime{990}};
  const auto cookies = [&] {
    std::vector<std::string> all;
    const auto kept = tokens.sessions().value();
    for (const auto& one : kept) all.push_back(one.cookie_sha256_hex.substr(0, 1));
    return all;
  };
  for (const auto& one : {late, early}) ASSERT_TRUE(tokens.keep_session(one, UtcTime{100}));
  EXPECT_THAT(cookies(), ElementsAre("c", "b"));
  EXPECT_EQ(tokens.sessions().value()[1].token, token.id);
  EXPECT_EQ(tokens.sessions().value()[1].until, UtcTime{900});
  EXPECT_EQ(tokens.keep_session(late, UtcTime{100}).error().code, Errc::conflict);
  EXPECT_EQ(tokens.keep_session({std::string(64, 'e'), {}, UtcTime{900}}, UtcTime{100}).error().code,
            Errc::not_found);
  ASSERT_TRUE(tokens.keep_session(after, UtcTime{500}));
  EXPECT_THAT(cookies(), ElementsAre("b", "d"));
  ASSERT_TRUE(tokens.end_session(late.cookie_sha256_hex));
  ASSERT_TRUE(tokens.end_session(late.cookie_sha256_hex));
  EXPECT_THAT(cookies(), ElementsAre("d"));
}

TEST_P(AccessContract, KeepsTheSitesThatATokenIsBoundTo) {
  const SiteId north{make_uuid_v7(k_noon)}, south{make_uuid_v7(k_noon)};
  Token bound{TokenId{make_uuid_v7(k_noon)},
              "north",
              std::string(64, 'a'),
              {"viewer"},
              k_noon,
              {},
              {},
              {},
              {},
              {},
              {}};
  bound.sites = SiteSet::only({south, north, north});
  Token nothing = bound;
  nothing.id = TokenId{make_uuid_v7(k_noon)};
  nothing.secret_sha256_hex = std::string(64, 'b');
  nothing.sites = SiteSet::only({});
  Token all = nothing;
  all.id = TokenId{make_uuid_v7(k_noon)};
  all.secret_sha256_hex = std::string(64, 'c');
  all.sites = {};
  for (const auto& token : {bound, nothing, all}) ASSERT_TRUE(db_->stores().tokens.insert(token));
  const auto found = db_->stores().tokens.token(bound.id).value().sites;
  ASSERT_FALSE(found.all());
  EXPECT_THAT(*found.sites(), ElementsAre(north, south));
  EXPECT_TRUE(found.holds(north));
  EXPECT_FALSE(found.holds(std::nullopt));
  const auto none = db_->stores().tokens.token_by_secret(std::string(64, 'b')).value().sites;
  EXPECT_FALSE(none.all());
  EXPECT_FALSE(none.holds(north));
  EXPECT_TRUE(db_->stores().tokens.token(all.id).value().sites.all());
}

TEST_P(AccessContract, FailsJobsThatARestartCutOff) {
  Job running;
  running.id = JobId{make_uuid_v7(k_noon)};
  running.kind = "calibration";
  running.state = JobState::running;
  running.fraction = 0.42;
  Job done = running;
  done.id = JobId{make_uuid_v7(k_noon)};
  done.state = JobState::succeeded;
  ASSERT_TRUE(db_->stores().jobs.insert(running));
  ASSERT_TRUE(db_->stores().jobs.insert(done));
  EXPECT_EQ(db_->stores().jobs.fail_unfinished(k_noon, {"{}"}).value(), 1u);
  const auto found = db_->stores().jobs.job(running.id).value();
  EXPECT_EQ(found.state, JobState::failed);
  EXPECT_EQ(found.fraction, 0.42);
  EXPECT_EQ(found.finished, k_noon);
  EXPECT_EQ(db_->stores().jobs.job(done.id).value().state, JobState::succeeded);
  done.detail = "x";
  done.worker = "host/7";
  done.attempts = 2;
  ASSERT_TRUE(db_->stores().jobs.update(done));
  EXPECT_EQ(db_->stores().jobs.job(done.id).value().worker, "host/7");
  EXPECT_EQ(db_->stores().jobs.job(done.id).value().attempts, 2);
  EXPECT_EQ(db_->stores().jobs.jobs(10, std::nullopt).value().size(), 2u);
  EXPECT_EQ(db_->stores().jobs.job(JobId{}).error().code, Errc::not_found);
}

TEST_P(AccessContract, KeepsOneAnswerForAPrincipalAndKey) {
  const StoredAnswer answer{"key", "me", "hash", std::string("a\0b", 3), "/there", "\"7\"", 201, 1000};
  ASSERT_TRUE(db_->stores().access.keep_answer(answer, 0));
  EXPECT_EQ(db_->stores().access.keep_answer(answer, 1000).error().code, Errc::conflict);
  ASSERT_TRUE(db_->stores().access.keep_answer(answer, 1001)) << "in the place of one that has expired";
  EXPECT_EQ(db_->stores().access.answer_use("me").value().count, 1u);
  EXPECT_EQ(db_->stores().access.answer_use("me").value().bytes, 3u);
  EXPECT_EQ(db_->stores().access.answer_use("you").value().count, 0u);
  const auto found = db_->stores().access.answer("me", "key").value();
  ASSERT_TRUE(found);
  EXPECT_EQ(found->body, answer.body);
  EXPECT_EQ(found->status, 201);
  EXPECT_EQ(found->location, "/there");
  EXPECT_EQ(found->etag, "\"7\"");
  EXPECT_FALSE(db_->stores().access.answer("you", "key").value());
  EXPECT_EQ(db_->stores().access.drop_answers_before(1000, 10).value(), 0u);
  EXPECT_EQ(db_->stores().access.drop_answers_before(1001, 10).value(), 1u);
  for (int i = 0; i < 5; ++i) {
    StoredAnswer one = answer;
    one.key = std::to_string(i);
    one.created_ran_ns = 10 * i;
    ASSERT_TRUE(db_->stores().access.keep_answer(one, 0));
  }
  EXPECT_EQ(db_->stores().access.drop_answers_before(100, 2).value(), 2u) << "a slice";
  EXPECT_EQ(db_->stores().access.drop_oldest_answers("me", 2).value(), 2u);
  EXPECT_TRUE(db_->stores().access.answer("me", "4").value()) << "the youngest stays";
  EXPECT_EQ(db_->stores().access.answer_use("me").value().count, 1u);
}

/// What a thread writes for a request leaves the mark with it or not at all, and its answer takes the place
/// of that.
TEST_P(AccessContract, MarksWhatARequestWritesInTheSameTransaction) {
  auto& access = db_->stores().access;
  StoredAnswer begun;
  begun.principal = "gate", begun.key = "k", begun.created_ran_ns = 5;
  const auto status = [&] {
    const auto found = access.answer("gate", "k").value();
    return found ? found->status : -1;
  };
  Token token{TokenId{make_uuid_v7(k_noon)},
              "gate",
              std::string(64, 'a'),
              {"viewer"},
              k_noon,
              {},
              {},
              {},
              {},
              {},
              {}};
  ASSERT_TRUE(db_->stores().tokens.insert(token));
  {
    const RequestMark mark(begun);
    EXPECT_FALSE(db_->stores().tokens.insert(token)) << "it is there already";
    ASSERT_TRUE(access.append_audit({UtcTime{1}, "gate", "will do", "here", ""}));
    EXPECT_EQ(status(), -1) << "nothing was done";
  }
  ASSERT_TRUE(db_->stores().tokens.touch(token.id, UtcTime{6}));
  EXPECT_EQ(status(), -1) << "written for nobody";
  const RequestMark mark(begun);
  ASSERT_TRUE(db_->stores().tokens.touch(token.id, UtcTime{7}));
  EXPECT_EQ(status(), 0);
  StoredAnswer done = begun;
  done.status = 201;
  ASSERT_TRUE(access.keep_answer(done, 0));
  EXPECT_EQ(status(), 201);
  EXPECT_EQ(access.keep_answer(done, 0).error().code, Errc::conflict) << "an answer stays";
}

TEST_P(AccessContract, ChainsTheAuditLog) {
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(
        db_->stores().access.append_audit({UtcTime{i}, "me", "publish", "127.0.0.1", std::to_string(i)}));
  }
  const auto entries = db_->stores().access.audit(2).value();
  ASSERT_EQ(entries.size(), 2u);
  EXPECT_EQ(entries[0].result, "2");
  EXPECT_TRUE(db_->stores().access.verify_audit());
}

INSTANTIATE_TEST_SUITE_P(Backends, AccessContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::access_contract_test
