// What the body of POST /calibrations is read as.
#include "api/calibration/calibration_service.hpp"
#include "app_fixture.hpp"

namespace anchord::test::calibration_request_test {
namespace {

TEST(CalibrationRequest, TakesPriorsUnderTheNameTheyHadUpTo01ButNotUnderBoth) {
  const Json square = {{"outline_m", {{-5, -5}, {5, -5}, {5, 5}, {-5, 5}}}};
  const auto read = [](const Json& more, std::vector<api::FieldError>& errors) {
    Json body{{"missions", {"0197e6a0-0000-7000-8000-000000000001"}}};
    body.update(more);
    return api::read_calibration_request(body, errors);
  };
  for (const std::string name : {"priors", "clues"}) {
    std::vector<api::FieldError> errors;
    EXPECT_EQ(read({{name, square}}, errors).options.outline_m.size(), 4u) << name;
    EXPECT_TRUE(read({{"flight_" + name, true}}, errors).flight_priors) << name;
    EXPECT_FALSE(read({{"flight_" + name, false}}, errors).flight_priors) << name;
    (void)read({{name, nullptr}, {"flight_" + name, nullptr}}, errors);
    EXPECT_TRUE(errors.empty()) << name << ": " << errors.front().pointer << " " << errors.front().detail;
    (void)read({{name, {{"outline", 1}}}}, errors);
    ASSERT_EQ(errors.size(), 1u) << name;
    EXPECT_EQ(errors[0].pointer, "/" + name + "/outline") << "as it was sent";
  }
  std::vector<api::FieldError> errors;
  (void)read({{"priors", square}, {"clues", square}, {"flight_priors", true}, {"flight_clues", true}},
             errors);
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_EQ(errors[0].pointer, "/clues");
  EXPECT_EQ(errors[0].detail, "is the former name of priors: send one of them");
  EXPECT_EQ(errors[1].pointer, "/flight_clues");
}

}  // namespace
}  // namespace anchord::test::calibration_request_test
