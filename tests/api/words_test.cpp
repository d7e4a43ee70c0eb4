// Each word of a request becomes the value of its name, whatever the order of the enum behind it.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "api/calibration/calibration_service.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

FlightOptions asked(const char* key, const Json& value) {
  std::vector<FieldError> errors;
  const Json body{{"missions", {"0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"}}, {key, value}};
  auto request = read_calibration_request(body, errors);
  EXPECT_TRUE(errors.empty()) << key << " " << value << ": " << (errors.empty() ? "" : errors.front().detail);
  return request.options;
}

TEST(CalibrationRequestWords, NameTheSolver) {
  EXPECT_EQ(asked("solver", "gauss_newton").method, anchord::Method::gauss_newton);
  EXPECT_EQ(asked("solver", "levenberg_marquardt").method, anchord::Method::levenberg_marquardt);
  EXPECT_EQ(asked("solver", "dogleg").method, anchord::Method::dogleg);
}

TEST(CalibrationRequestWords, NameWeightsAndLoss) {
  EXPECT_EQ(asked("weights", "inverse_variance").weights, Weights::inverse_variance);
  EXPECT_EQ(asked("weights", "dissertation").weights, Weights::as_printed);
  EXPECT_EQ(asked("loss", {{"type", "none"}}).loss, Loss::none);
  EXPECT_EQ(asked("loss", {{"type", "huber"}}).loss, Loss::huber);
  EXPECT_EQ(asked("loss", {{"type", "cauchy"}}).loss, Loss::cauchy);
  EXPECT_EQ(asked("loss", {{"type", "tukey"}}).loss, Loss::tukey);
}

TEST(CalibrationRequestWords, NameTheLeastFix) {
  EXPECT_EQ(asked("min_fix", "none").min_fix, FixClass::none);
  EXPECT_EQ(asked("min_fix", "single").min_fix, FixClass::single);
  EXPECT_EQ(asked("min_fix", "dgps").min_fix, FixClass::dgps);
  EXPECT_EQ(asked("min_fix", "float").min_fix, FixClass::rtk_float);
  EXPECT_EQ(asked("min_fix", "fixed").min_fix, FixClass::rtk_fixed);
}

TEST(CalibrationRequestWords, RefuseAnotherWordWithThoseThereAre) {
  std::vector<FieldError> errors;
  read_calibration_request(Json{{"missions", {"0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"}}, {"solver", "newton"}},
                           errors);
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors.front().pointer, "/solver");
  EXPECT_EQ(errors.front().detail, "must be one of gauss_newton, levenberg_marquardt, dogleg");
}

}  // namespace
}  // namespace anchord::api
