// What the gateway makes of each answer. The expectations are RFC 9110 (statuses, Retry-After) and
// docs/gateway.md.
#include "server/gateway/answer.hpp"

#include <gtest/gtest.h>

namespace anchord::gateway::answer_test {
namespace {

using std::chrono::seconds;

const UtcTime k_now = parse_rfc3339("2026-05-04T10:11:12Z").value();

Assessment of(int status, std::string_view body, std::uint64_t n_rows = 3,
              const std::map<std::string, std::string>& headers = {}) {
  return assess(status, headers, body, n_rows, k_now);
}

TEST(GatewayAnswer, SettlesRowsOnlyByAReportAboutJustSoMany) {
  const auto good = of(200, R"({"accepted":1,"duplicates":1,"rejected":1,"errors":[
      {"line":3,"code":"zero_distance","pointer":"/distance_m","detail":"0 mm"},
      {"line":3,"code":"required","pointer":"/tag","detail":"is missing"}],"errors_truncated":false})");
  ASSERT_EQ(good.then, Then::settled);
  EXPECT_EQ(good.report.accepted, 1u);
  EXPECT_FALSE(good.report.truncated);
  ASSERT_EQ(good.report.errors.size(), 1u);
  EXPECT_EQ(good.report.errors[0].line, 3u);
  EXPECT_EQ(good.report.errors[0].detail, "/distance_m: 0 mm; /tag: is missing");
  EXPECT_EQ(of(422, R"({"accepted":0,"duplicates":0,"rejected":3,"errors":[]})").then, Then::settled);
  EXPECT_TRUE(of(422, R"({"accepted":0,"duplicates":0,"rejected":3,"errors":[]})").report.truncated);

  const auto fewer = of(200, R"({"accepted":1,"duplicates":1,"rejected":0,"errors":[]})");
  EXPECT_EQ(fewer.then, Then::wait);
  EXPECT_EQ(fewer.link, Link::refused);
}

TEST(GatewayAnswer, KeepsEverythingWhereAnotherProgramAnswers) {
  for (const int status : {200, 302, 400, 405, 415, 422}) {
    const auto page = of(status, "<html>please log in</html>");
    EXPECT_EQ(page.then, Then::wait) << status;
    EXPECT_EQ(page.link, Link::refused) << status;
  }
}

TEST(GatewayAnswer, WaitsAsLongAsTheServerSays) {
  for (const int status : {429, 503}) {
    const auto busy = of(status, "{}", 3, {{"retry-after", "7"}});
    EXPECT_EQ(busy.then, Then::wait);
    EXPECT_EQ(busy.link, Link::busy);
    EXPECT_EQ(busy.wait, seconds(7));
  }
  EXPECT_EQ(retry_after("Mon, 04 May 2026 10:11:42 GMT", k_now), seconds(30));
  EXPECT_EQ(retry_after("Mon, 04 May 2026 10:11:00 GMT", k_now), seconds(0));
  EXPECT_EQ(retry_after("100000", k_now), seconds(600));
  EXPECT_EQ(retry_after("soon", k_now), std::nullopt);
  EXPECT_EQ(of(503, "{}").wait, std::nullopt);
  EXPECT_GE(of(507, "{}").wait.value(), seconds(5));
}

TEST(GatewayAnswer, TellsHowFarTheClockHereIsFromTheServersAndNotWhatTheDelayMayBe) {
  const auto at = [](std::string_view time) { return parse_rfc3339(time).value(); };
  const std::map<std::string, std::string> date{{"date", "Mon, 04 May 2026 10:11:12 GMT"}};
  const auto ahead_s = [&](std::string_view sent, std::string_view received) {
    return clock_ahead_s(date, at(sent), at(received));
  };
  EXPECT_EQ(ahead_s("2026-05-04T12:11:13Z", "2026-05-04T12:11:14Z"), 7200);
  EXPECT_EQ(ahead_s("2026-05-04T08:11:11Z", "2026-05-04T08:11:12Z"), -7200);
  EXPECT_EQ(ahead_s("2026-05-04T10:11:12.9Z", "2026-05-04T10:11:12.95Z"), 0) << "a date has whole seconds";
  EXPECT_EQ(ahead_s("2026-05-04T10:11:00Z", "2026-05-04T10:11:30Z"), 0) << "the answer took half a minute";
  EXPECT_EQ(clock_ahead_s({{"date", "today"}}, k_now, k_now), std::nullopt);
  EXPECT_EQ(clock_ahead_s({}, k_now, k_now), std::nullopt);
}

TEST(GatewayAnswer, SaysWhatToDoAboutATokenThatIsNotTaken) {
  for (const int status : {401, 403}) {
    const auto refused = of(status, R"({"detail":"no"})");
    EXPECT_EQ(refused.then, Then::wait);
    EXPECT_EQ(refused.link, Link::unauthorized);
    EXPECT_NE(refused.why.find("gateway"), std::string::npos) << refused.why;
  }
  EXPECT_NE(of(401, "{}").why.find("anchord token create"), std::string::npos);
}

TEST(GatewayAnswer, HalvesWhatIsTooLargeOrInConflictAndHoldsAMissionThatIsNotThere) {
  EXPECT_EQ(of(413, "{}").then, Then::halve);
  EXPECT_EQ(of(409, "{}").then, Then::halve);
  EXPECT_EQ(of(404, R"({"detail":"there is no mission"})").then, Then::hold);
  EXPECT_EQ(of(410, "{}").then, Then::hold);
}

TEST(GatewayAnswer, PausesDoubleUpToALimitAndAreNeverAlike) {
  Pauses pauses{std::chrono::milliseconds(250), std::chrono::milliseconds(2400)};
  EXPECT_EQ(pauses.next(0.5).count(), 250);
  EXPECT_EQ(pauses.next(0.5).count(), 500);
  EXPECT_EQ(pauses.next(0.5).count(), 1000);
  for (int i = 0; i < 40; ++i) EXPECT_LE(pauses.next(0.999).count(), 3000);
  EXPECT_EQ(pauses.next(0).count(), 1800);
  pauses.reset();
  EXPECT_EQ(pauses.next(0.5).count(), 250);
}

}  // namespace
}  // namespace anchord::gateway::answer_test
