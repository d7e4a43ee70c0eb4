#include "api/formats/plan_input.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "api/formats/plan_output.hpp"
#include "tests/paths.hpp"

namespace anchord::api::plan_input_test {
namespace {

using ::testing::HasSubstr;

std::vector<std::string> pointers(std::string_view json) {
  std::vector<FieldError> errors;
  EXPECT_FALSE(read_plan_input(json, errors));
  std::vector<std::string> out;
  for (const auto& e : errors) out.push_back(e.pointer + " " + e.code);
  return out;
}

TEST(PlanInput, ReadsTheExampleOfTheDocumentationAndDecidesAsTheDissertation) {
  std::ifstream file(ANCHORD_TEST_DATA "/../../docs/examples/plan_next.json");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::vector<FieldError> errors;
  const auto request = read_plan_input(text, errors);
  ASSERT_TRUE(request) << (errors.empty() ? "" : errors[0].pointer + errors[0].detail);
  const auto decision = planning::next_point(request->input, request->options).value();
  const auto p = decision.candidates[decision.chosen.value()].point_m;
  EXPECT_NEAR(p.x(), 2.52, 1e-12);  // Fig 8.8
  EXPECT_NEAR(p.y(), -0.48, 1e-12);
  const auto json = decision_json(decision, *request);
  EXPECT_THAT(json, HasSubstr("\"value_is\": \"gdop_trace\""));
  EXPECT_THAT(json, HasSubstr("\"refused\": \"visited\""));
  EXPECT_THAT(json, HasSubstr("\"value_before\": null"));
  EXPECT_THAT(decision_text(decision, *request), HasSubstr("next: (2.520, -0.480, 0.000) m"));
}

TEST(PlanInput, ReportsEverythingWrongAtOnceWithItsPointer) {
  EXPECT_THAT(pointers(R"({"dims":2,"visited_m":[[1,2],[1,"x"],[3]],"rule":"best","stepp":1,
      "anchors":[{"position_m":[0,0],"measured_at":[9]},{"name":"b"}],"grid":{"step_m":-1}})"),
              ::testing::UnorderedElementsAre("/visited_m/1/1 wrong_type", "/visited_m/2 wrong_type",
                                              "/rule unknown_value", "/stepp unknown_field",
                                              "/anchors/0/measured_at out_of_range",
                                              "/anchors/1/position_m required", "/grid/step_m out_of_range"));
}

TEST(PlanInput, RefusesWhatIsNoPlanAtAll) {
  EXPECT_THAT(pointers("{"), ::testing::ElementsAre(HasSubstr("malformed")));
  EXPECT_THAT(pointers("[]"), ::testing::ElementsAre(HasSubstr("wrong_type")));
  EXPECT_THAT(pointers("{}"), ::testing::UnorderedElementsAre("/visited_m required", "/anchors required"));
  EXPECT_THAT(pointers(R"({"visited_m":[[1,2,3]],"anchors":[{"position_m":[1,2,NaN]}]})"),
              ::testing::SizeIs(1));
}

TEST(PlanInput, NeedsHeightsInSpaceAndAllowsThemInThePlane) {
  EXPECT_THAT(pointers(R"({"visited_m":[[1,2]],"anchors":[{"position_m":[1,2,3]}]})"),
              ::testing::ElementsAre("/visited_m/0 wrong_type"));
  std::vector<FieldError> errors;
  EXPECT_TRUE(
      read_plan_input(R"({"dims":2,"visited_m":[[1,2,9]],"anchors":[{"position_m":[5,2]}]})", errors));
}

TEST(PlanInput, RefusesAMatrixThatIsNoCovariance) {
  EXPECT_THAT(
      pointers(R"({"visited_m":[[1,2,3]],"anchors":[{"position_m":[1,2,9],"covariance_m2":[1,2,0,1,0,1]}]})"),
      ::testing::ElementsAre("/anchors/0/covariance_m2 out_of_range"));
}

TEST(PlanInput, TakesWallsFenceAndMirror) {
  std::vector<FieldError> errors;
  const auto request = read_plan_input(
      R"({"visited_m":[[1,2,3],[2,2,3]],"fence_m":[[0,0],[9,0],[9,9]],"no_fly_m":[[[4,4],[5,4],[5,5]]],
          "obstacles":[{"wall_m":[[0,1],[2,3]],"keep_out_m":0.5,"p_nlos":0.25}],"keep_out_m":2,
          "anchors":[{"position_m":[1,2,9],"probability":0.7,"mirror":{"position_m":[1,-2,9],"probability":0.3}}],
          "grid":{"step_m":1,"neighbourhood":26}})",
      errors);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->input.bounds.fence.size(), 3U);
  EXPECT_EQ(request->input.bounds.no_fly.size(), 1U);
  EXPECT_EQ(request->input.bounds.walls.at(0).p_nlos, 0.25);
  EXPECT_EQ(request->input.anchors.at(0).places.size(), 2U);
  EXPECT_EQ(request->input.anchors.at(0).measured_at.size(), 2U);
  EXPECT_EQ(request->options.grid.reach_up, 1);
}

}  // namespace
}  // namespace anchord::api::plan_input_test
