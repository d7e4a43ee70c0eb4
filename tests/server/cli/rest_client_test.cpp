#include "server/cli/rest_client.hpp"

#include "api/measurements/flight_requests.hpp"
#include "server/cli/replay_missions.hpp"
#include "tests/server/app/app_fixture.hpp"

namespace anchord::test::rest_client_test {
namespace {

/// A client as the commands use it, and a mission to send rows to.
class RestClientTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(server_.app) << server_.error.message;
    client_ = cli::RestClient::make(server_.url, server_.admin, [] { return false; }).value();
    const auto made = client_->post("/api/v1/missions?devices=false", "application/json",
                                    R"({"name":"m","frame":"wgs84","track_point":"gnss_antenna","tags":[]})");
    ASSERT_TRUE(made) << made.error().message;
    mission_ = api::parse_created_id(made.value()).value();
  }
  Result<std::string> send(const std::string& lines) {
    return client_->post("/api/v1/ranges?mission=" + mission_, "application/x-ndjson", lines);
  }
  static std::string line(int i, const std::string& distance) {
    return R"({"t_us":)" + std::to_string(1'777'889'472'000'000 + i) +
           R"(,"tag":"0x6e01","anchor":"0x6a2f","distance_m":)" + distance + "}\n";
  }
  AppFixture server_;
  std::unique_ptr<cli::RestClient> client_;
  std::string mission_;
};

TEST_F(RestClientTest, TakesTheReportOfRowsThatAreAllRefusedForTheAnswerItIsAndGoesOn) {
  const auto refused = send(line(1, "0") + line(2, "0"));
  ASSERT_TRUE(refused) << refused.error().message;
  const auto report = api::parse_ingest_answer(refused.value());
  ASSERT_TRUE(report) << refused.value();
  EXPECT_EQ(report.value().rejected, 2u);
  EXPECT_EQ(report.value().first_error.substr(0, 14), "zero_distance:");
  const auto next = send(line(3, "7.5"));
  ASSERT_TRUE(next) << next.error().message;
  EXPECT_EQ(api::parse_ingest_answer(next.value()).value().accepted, 1u);
}

TEST_F(RestClientTest, TakesAnotherRefusalForAnError) {
  const auto wrong = client_->post("/api/v1/missions", "application/json", R"({"name":"m","frame":"mars"})");
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().message.find("422"), std::string::npos) << wrong.error().message;
}

// A gateway that starts without a server records under a marker until it knows the mission.
TEST(ReplayMissions, RowsFromBeforeAMissionWasKnownAreOfTheFirstOneNamedAfterwards) {
  const auto mission = [](std::uint8_t n) {
    MissionId id;
    id.uuid.bytes[15] = n;
    return id;
  };
  const MissionId none = gateway::unassigned(), a = mission(1), b = mission(2);
  const std::vector<MissionId> recorded{none, none, a, a, none, b, none};
  cli::ReplayMissions missions;
  for (const auto& id : recorded) missions.note(id);
  std::vector<MissionId> rows;
  for (const auto& id : recorded) rows.push_back(missions.of(id));
  EXPECT_EQ(rows, (std::vector<MissionId>{a, a, a, a, b, b, none})) << "nothing is named after the last";
}

}  // namespace
}  // namespace anchord::test::rest_client_test
