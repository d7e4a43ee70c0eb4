// Each word of a request becomes the value of its name, whatever the order of the enum behind it.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "api/calibration/calibration_service.hpp"
#include "api/kit/contract.hpp"
#include "api/wire/words.hpp"

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

/// The words of the table, and back to the value each of them stands for.
template <class T, std::size_t N>
Json both_ways(const std::array<Word<T>, N>& table) {
  Json words = Json::array();
  for (const auto& row : table) {
    EXPECT_EQ(word_of(table, row.value), row.word);
    EXPECT_EQ(value_of(table, row.word), row.value);
    words.push_back(row.word);
  }
  EXPECT_EQ(value_of(table, "another"), std::nullopt);
  return words;
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

TEST(WireWords, AreThoseOfTheContractAndMeanOneValueEach) {
  const auto schemas = Json::parse(openapi_json()).at("components").at("schemas");
  const auto words = [&](const char* schema, const char* property) {
    return schemas.at(schema).at("properties").at(property).at("enum");
  };
  EXPECT_EQ(both_ways(k_fix_words), schemas.at("FixClass").at("enum"));
  EXPECT_EQ(both_ways(k_frame_words), words("MissionCreate", "frame"));
  EXPECT_EQ(both_ways(k_point_words), words("MissionCreate", "track_point"));
  EXPECT_EQ(both_ways(k_range_kind_words), words("RangeIn", "kind"));
}

}  // namespace
}  // namespace anchord::api
