// Retention of impulse responses as its users see it: by the rule, and by hand.
#include "core/ports/cir_archive.hpp"

#include <gmock/gmock.h>

#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "tests/api/app_fixture.hpp"

namespace anchord::test::cir_archive_test {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t k_day_ns = 86'400LL * 1'000'000'000;

class CirArchiveApi : public AppFixture {
 protected:
  void configure(api::Application::Deps& deps) override {
    deps.cir_archive = &database_->cir_archive();
    deps.keep_cir_days = keep_days_;
    deps.storage_status = [this] {
      api::StorageStatus status;
      status.disk_free_bytes = free_bytes_;
      return status;
    };
  }
  /// With 12 ranges, ten of which have a response; landed so many days ago, or in the air.
  std::string flight(std::optional<int> landed_days_ago) {
    const auto id = mission();
    std::vector<Range> rows;
    for (int i = 0; i < 12; ++i) {
      Range row;
      row.mission = MissionId{parse_uuid(id).value()};
      row.time = UtcTime{clock_.now().ns + i * 1'000'000};
      row.tag = NetworkId{0x6e01};
      row.anchor = NetworkId{0x6a2f};
      row.distance_m = 5;
      if (i >= 2) row.cir = Cir{{static_cast<std::int16_t>(i), -2, 3, -4}, 1001.6, 744.5, 1000};
      rows.push_back(row);
    }
    EXPECT_TRUE(database_->stores().measurements.append_ranges(rows, true));
    const MissionId key{parse_uuid(id).value()};
    const auto landed = UtcTime{clock_.now().ns - landed_days_ago.value_or(0) * k_day_ns};
    EXPECT_TRUE(!landed_days_ago || database_->stores().missions.finish(key, landed).has_value());
    return id;
  }
  std::vector<std::string> archived() {
    std::vector<std::string> out;
    const Json list = json(get("/api/v1/cir-archive"));
    for (const auto& one : list["items"])
      if (one["n_moved"] > 0) out.push_back(one["mission"]);
    return out;
  }
  api::Response move(const std::string& mission, const std::string& to) {
    Call options;
    options.headers["prefer"] = "wait=30";
    return call(api::Method::post, "/api/v1/missions/" + mission + "/cir-archive", R"({"to":")" + to + "\"}",
                options);
  }
  Json system() { return json(get("/api/v1/system"))["cir_archive"]; }

  std::optional<std::int64_t> keep_days_{30};
  std::uint64_t free_bytes_{10ULL << 30};
};

TEST_F(CirArchiveApi, MovesWhatLandedLongerAgoThanTheRuleAllows) {
  const auto old = flight(31), recent = flight(29), flying = flight(std::nullopt);
  const auto before = json(get("/api/v1/ranges", {{"mission", old}, {"cir", "true"}}));
  app_->housekeeping_round();
  EXPECT_THAT(archived(), ::testing::ElementsAre(old));
  EXPECT_EQ(json(get("/api/v1/ranges", {{"mission", old}, {"cir", "true"}})), before);
  EXPECT_EQ(system()["keep_days"], 30);
  EXPECT_EQ(system()["n_moved"], 10);
  EXPECT_EQ(system()["flights"], 1);
  EXPECT_GT(system()["file_bytes"], 0);
  EXPECT_TRUE(system()["problem"].is_null());
  EXPECT_THAT(get("/api/v1/audit").body, HasSubstr("cir.archive " + old));
  EXPECT_THAT(get("/api/v1/events").body, HasSubstr("cir.archived"));
}

TEST_F(CirArchiveApi, MovesNothingByItselfWhereThereIsNoRule) {
  keep_days_.reset();
  restart();
  const auto old = flight(1000);
  app_->housekeeping_round();
  EXPECT_TRUE(archived().empty());
  EXPECT_TRUE(system()["keep_days"].is_null());
  const auto by_hand = move(old, "file");
  EXPECT_EQ(by_hand.status, 200) << by_hand.body;
  EXPECT_EQ(json(by_hand)["n_moved"], 10);
  EXPECT_THAT(get("/api/v1/audit").body, HasSubstr("cir.archive " + old + " to file"));
}

TEST_F(CirArchiveApi, LeavesInTheDatabaseWhatWasBroughtBack) {
  const auto old = flight(31);
  app_->housekeeping_round();
  const auto back = move(old, "database");
  EXPECT_EQ(back.status, 200) << back.body;
  EXPECT_EQ(json(back)["n_moved"], 0);
  EXPECT_TRUE(json(back)["held"]);
  app_->housekeeping_round();
  EXPECT_TRUE(archived().empty());
  EXPECT_EQ(move(old, "file").status, 200);
  EXPECT_THAT(archived(), ::testing::ElementsAre(old));
}

TEST_F(CirArchiveApi, RefusesAFlightInTheAirAndWordsItDoesNotKnow) {
  const auto flying = flight(std::nullopt), without = flight(2);
  EXPECT_EQ(move(flying, "file").status, 409);
  EXPECT_EQ(move(without, "database").status, 404);
  EXPECT_EQ(move(flying, "tape").status, 422);
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(api::Method::get, "/api/v1/cir-archive", "", viewer).status, 403);
}

TEST_F(CirArchiveApi, HasNothingToMoveOfAFlightWithoutResponses) {
  const auto id = mission();
  ASSERT_TRUE(database_->stores().missions.finish(MissionId{parse_uuid(id).value()}, clock_.now()));
  EXPECT_EQ(move(id, "file").status, 404);
  EXPECT_TRUE(archived().empty());
}

TEST_F(CirArchiveApi, WritesNoFileOnADiskThatIsNearlyFull) {
  const auto old = flight(31);
  free_bytes_ = 900ULL << 20;
  app_->housekeeping_round();
  EXPECT_TRUE(archived().empty());
  EXPECT_THAT(system()["problem"].get<std::string>(), HasSubstr("900 MiB free on the disk, 1024 needed"));
  EXPECT_EQ(move(old, "file").status, 507);
  free_bytes_ = 10ULL << 30;
  app_->housekeeping_round();
  EXPECT_THAT(archived(), ::testing::ElementsAre(old));
  EXPECT_TRUE(system()["problem"].is_null());
}

TEST_F(CirArchiveApi, NamesTheFileThatARangeNeeds) {
  const auto old = flight(31);
  app_->housekeeping_round();
  std::filesystem::remove_all(dir_ / "data" / "cir-archive");
  const auto list = get("/api/v1/ranges", {{"mission", old}});
  ASSERT_EQ(list.status, 200);
  const auto id = json(list)["items"][5]["id"].dump();
  const auto cir = get("/api/v1/ranges/" + id + "/cir");
  EXPECT_EQ(cir.status, 503);
  EXPECT_THAT(json(cir)["detail"].get<std::string>(), HasSubstr(old + "-*.db"));
  EXPECT_FALSE(json(get("/api/v1/cir-archive"))["items"][0]["here"]);
}

}  // namespace
}  // namespace anchord::test::cir_archive_test
