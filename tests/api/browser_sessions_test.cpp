#include "kept_fixture.hpp"

namespace anchord::browser_sessions_test {
namespace {

constexpr std::int64_t k_hour_ns = 3'600'000'000'000;

/// A browser is signed in at one server; what the next one over the same database says of it.
class BrowserSessions : public test::KeptFixture {
 protected:
  void SetUp() override {
    KeptFixture::SetUp();
    options_.steady = &steady_;
    first_ = service();
    const api::Principal admin{"a", "a", {api::Role::admin}};
    auto made = first_->create_token("tablet", {"operator"}, std::nullopt, admin, "here");
    ASSERT_TRUE(made);
    token_ = std::move(made).value();
    cookie_ = first_->open_session(token_.text, "here").value();
  }
  void TearDown() override {
    first_.reset();
    KeptFixture::TearDown();
  }
  std::unique_ptr<api::AccessService> service() {
    auto made = std::make_unique<api::AccessService>(database_->stores(), clock_, options_);
    EXPECT_TRUE(made->load());
    return made;
  }

  api::AccessOptions options_;
  std::unique_ptr<api::AccessService> first_;
  api::NewToken token_;
  std::string cookie_;
};

TEST_F(BrowserSessions, OutliveTheServerWithTheRolesOfTheirToken) {
  const auto who = service()->session(cookie_);
  ASSERT_TRUE(who);
  EXPECT_EQ(who->name, "tablet");
  EXPECT_EQ(who->roles, std::vector{api::Role::op});
}

TEST_F(BrowserSessions, AreOverForTheNextServerAfterALogout) {
  first_->close_session(cookie_, "here");
  EXPECT_FALSE(service()->session(cookie_));
  EXPECT_TRUE(database_->stores().tokens.sessions().value().empty());
}

TEST_F(BrowserSessions, AreOverForTheNextServerWhenTheirTokenWasRevoked) {
  ASSERT_TRUE(first_->revoke_token(token_.token.id, {"a", "a", {api::Role::admin}}, "here"));
  EXPECT_FALSE(service()->session(cookie_));
}

TEST_F(BrowserSessions, HaveTheirTimeOnceAndNotAnewWithEachServer) {
  now_s_ = now_s_ + 11 * 3600.0;
  clock_.ahead_s = 11 * 3600.0;
  const auto next = service();
  EXPECT_TRUE(next->session(cookie_));
  now_s_ = now_s_ + 3601.0;
  EXPECT_FALSE(next->session(cookie_));
  clock_.ahead_s = 12 * 3600.0 + 1;
  EXPECT_FALSE(service()->session(cookie_));
}

TEST_F(BrowserSessions, GetNoMoreThanTheirTimeFromAClockThatWentBack) {
  clock_.ahead_s = -300.0 * 86'400;
  const auto next = service();
  EXPECT_TRUE(next->session(cookie_));
  now_s_ = now_s_ + 12 * 3600.0 + 1;
  EXPECT_FALSE(next->session(cookie_));
}

TEST_F(BrowserSessions, ThatPushAnOlderOneOutDoSoForTheNextServerToo) {
  options_.max_sessions = 1;
  const auto one_only = service();
  const auto second = one_only->open_session(token_.text, "there").value();
  EXPECT_FALSE(service()->session(cookie_));
  EXPECT_TRUE(service()->session(second));
}

TEST_F(BrowserSessions, WhoseTimeIsOverLeaveTheStoreWithTheNextLogin) {
  clock_.ahead_s = 13 * 3600.0;
  const auto before = clock_.now();
  ASSERT_TRUE(first_->open_session(token_.text, "here"));
  const auto after = clock_.now();
  const auto kept = database_->stores().tokens.sessions().value();
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_GE(kept[0].until.ns, before.ns + 12 * k_hour_ns);
  EXPECT_LE(kept[0].until.ns, after.ns + 12 * k_hour_ns);
}

/// What lies on the disk opens nothing.
TEST_F(BrowserSessions, AreStoredWithoutTheirCookie) {
  const auto kept = database_->stores().tokens.sessions().value();
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_NE(kept[0].cookie_sha256_hex, cookie_);
  EXPECT_FALSE(service()->session(kept[0].cookie_sha256_hex));
}

}  // namespace
}  // namespace anchord::browser_sessions_test
