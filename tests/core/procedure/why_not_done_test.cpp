// The sentence that tells an operator why an anchor is not finished.
#include "core/procedure/why_not_done.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace anchord::procedure::why_not_done_test {
namespace {

using Eigen::Vector3d;

const std::vector<Vector3d> k_all_round{{10, 0, 3}, {0, 10, 9}, {-10, 0, 3}, {0, -10, 9}};

Estimate good() {
  Estimate e;
  e.verdict = Verdict::ok;
  e.best = Hypothesis{};
  e.best->covariance_m2 = Eigen::Matrix3d::Identity() * 0.03;  // 0.3 m in all
  e.n_used = 100;
  return e;
}
ExitRule five_centimetres() {
  ExitRule rule;
  rule.target_sigma_m = 0.05;
  return rule;
}
std::string why(const std::optional<Estimate>& e, const std::vector<Vector3d>& points = k_all_round) {
  return why_not_done(e, points, five_centimetres());
}

TEST(WhyNotDone, NamesTheFirstCauseWithItsNumbers) {
  EXPECT_EQ(why(std::nullopt), "too few ranges yet: 0 used");
  auto mirrored = good();
  mirrored.mirror = Hypothesis{};
  mirrored.mirror->position = Enu{{0, 0, 7}};
  EXPECT_EQ(why(mirrored).rfind("mirror: a solution 7.0 m away", 0), 0u) << why(mirrored);
  EXPECT_EQ(why(good(), {{10, 0, 3}, {0, 10, 3}, {-10, 0, 3.5}, {0, -10, 3}}).rfind("flat flight", 0), 0u);
  EXPECT_EQ(why(good(), {{10, -5, 3}, {10, 0, 9}, {10, 5, 3}}).rfind("seen from one side only", 0), 0u);
  auto refused = good();
  refused.refused["nlos"] = 150;
  EXPECT_EQ(why(refused), "too many ranges rejected: 150 of 250");
  auto biased = good();
  biased.bias_sigma_m = 0.3;
  EXPECT_EQ(why(biased), "bias and position cannot be distinguished: bias known to 0.30 m");
  EXPECT_EQ(why(good()), "accuracy 0.300 m, target 0.050 m");
  auto held = good();
  held.best->covariance_m2 *= 0.01;
  EXPECT_EQ(why(held), "more points needed");
  held.reason = "its height was taken for 8.00 m";
  EXPECT_EQ(why(held), "its height was taken for 8.00 m");
  held.gates = {{"redundancy", 90, 30, true, ""}, {"halves", 40, 16, false, "the halves disagree"}};
  EXPECT_EQ(why(held), "the halves disagree");
}

}  // namespace
}  // namespace anchord::procedure::why_not_done_test
