// What `anchord simulate drone --site` asks a running server for.
#include "server/cli/site_source.hpp"

#include <algorithm>

#include "api/measurements/flight_requests.hpp"
#include "server/http/http_client.hpp"
#include "tests/server/app/app_fixture.hpp"

namespace anchord::test::site_source_test {
namespace {

class SiteSource : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(server_.app) << server_.error.message;
    client_ = cli::RestClient::make(server_.url, server_.admin, [] { return false; }).value();
    site_ = made("/api/v1/sites", R"({"name":"ghent","origin":{"lon":3.7,"lat":51,"h_m":50}})");
  }
  std::string made(const std::string& path, const std::string& body) {
    const auto answer = client_->post(path, "application/json", body);
    EXPECT_TRUE(answer) << answer.error().message;
    return answer ? api::parse_created_id(answer.value()).value() : "";
  }
  void accept(const std::string& floor, const std::string& walls) {
    auto http = server::HttpClient::to(server_.url).value();
    http.set_header("Authorization", "Bearer " + server_.admin);
    const auto put = http.call("PUT", "/api/v1/floors/" + floor + "/walls", walls, "application/json",
                               {{"If-Match", "*"}});
    ASSERT_TRUE(put);
    ASSERT_EQ(put.value().status, 200) << put.value().body;
  }
  AppFixture server_;
  std::unique_ptr<cli::RestClient> client_;
  std::string site_;
};

TEST_F(SiteSource, MakesPanelsOfTheAcceptedWallsOfEveryFloor) {
  const auto building = made("/api/v1/buildings", R"({"name":"B1","height_m":7,"site":")" + site_ + "\"}");
  for (const char* level : {"0", "1"}) {
    const auto floor = made("/api/v1/floors", R"({"name":"F","level":)" + std::string(level) +
                                                  R"(,"building":")" + building + "\"}");
    accept(floor,
           R"({"walls":[{"from":[3.7,51],"to":[3.7001,51],"thickness_m":0.2,"material":"concrete"}]})");
  }
  const auto scene = cli::fetch_site_scene(*client_, site_);
  ASSERT_TRUE(scene) << scene.error().message;
  auto panels = scene.value().world.panels;
  ASSERT_EQ(panels.size(), 2u);
  std::ranges::sort(panels, {}, [](const sim::Panel& p) { return p.corner_m.z(); });
  EXPECT_DOUBLE_EQ(panels[0].corner_m.z(), 0);
  EXPECT_DOUBLE_EQ(panels[0].side_b_m.z(), 3) << "up to the floor above";
  EXPECT_DOUBLE_EQ(panels[1].corner_m.z(), 3);
  EXPECT_DOUBLE_EQ(panels[1].side_b_m.z(), 4) << "up to the roof";
  EXPECT_EQ(panels[0].material.name, "concrete");
  EXPECT_DOUBLE_EQ(scene.value().world.origin.height_m, 50);
}

TEST_F(SiteSource, RefusesASiteWithoutAnOriginOrThatIsNotThere) {
  const auto nowhere = made("/api/v1/sites", R"({"name":"nowhere"})");
  const auto scene = cli::fetch_site_scene(*client_, nowhere);
  ASSERT_FALSE(scene);
  EXPECT_NE(scene.error().message.find("has no origin"), std::string::npos) << scene.error().message;
  EXPECT_FALSE(cli::fetch_site_scene(*client_, "0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"));
  EXPECT_FALSE(cli::fetch_site_scene(*client_, "../tokens"));
}

}  // namespace
}  // namespace anchord::test::site_source_test
