// Whose code trains: our own, or OpenCV's where a run asks for it.
#include "tests/api/app_fixture.hpp"

namespace anchord::test::engine_test {
namespace {

class TrainingEngine : public AppFixture {
 protected:
  void SetUp() override {
    AppFixture::SetUp();
    std::string csv = "environment,setting,true_distance_m,los,range_m,rx_dbm,fp_dbm\n";
    for (int k = 0; k < 60; ++k) {
      const bool los = k % 2 == 0;
      const double distance_m = 2.0 + k % 10, rx_dbm = -75 - distance_m + 0.7 * (k % 7);
      for (int repeat = 0; repeat < 3; ++repeat) {
        const double off = 0.3 * (repeat - 1) + 0.05 * (k % 4);
        csv += "room " + std::to_string(k / 10) + ",s" + std::to_string(k) + "," +
               std::to_string(distance_m) + (los ? ",1," : ",0,") +
               std::to_string(distance_m + (los ? 0.05 : 0.55) + 0.03 * off) + "," +
               std::to_string(rx_dbm + off) + "," + std::to_string(rx_dbm - (los ? 2 : 8) - off) + "\n";
      }
    }
    ASSERT_EQ(post("/api/v1/campaigns", R"({"name":"hall"})").status, 201);
    ASSERT_EQ(post("/api/v1/campaigns/hall/samples", csv, "text/csv").status, 200);
    const auto made = post("/api/v1/datasets", R"({"name":"set","campaigns":["hall"],"aggregation":"none",
      "split":{"by":"environment","test":["room 5"]}})");
    ASSERT_EQ(made.status, 201) << made.body;
  }
  api::Response trained(const std::string& more) {
    Call options;
    options.headers["prefer"] = "wait=120";
    return call(
        api::Method::post, "/api/v1/training-runs",
        R"({"task":"nlos_id","dataset":"set","cv":{"folds":4,"seed":3},"importance":false,"engine":"opencv")" +
            more + "}",
        options);
  }
};

TEST_F(TrainingEngine, IsOpenCvWhereAsked) {
  const auto run = trained("");
  ASSERT_EQ(run.status, 201) << run.body;
  const auto model = json(get(json(run).value("model", "")));
  EXPECT_NE(model.dump().find("opencv "), std::string::npos) << model;
  EXPECT_EQ(trained(R"(,"methods":["random_forest"])").status, 201);
}

TEST_F(TrainingEngine, SaysWhatOpenCvHasWhereItHasNotWhatWasAsked) {
  const auto refused = trained(R"(,"methods":["logistic"])");
  EXPECT_EQ(refused.status, 422);
  EXPECT_NE(refused.body.find("svm and random_forest"), std::string::npos) << refused.body;
}

}  // namespace
}  // namespace anchord::test::engine_test
