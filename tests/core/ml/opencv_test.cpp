// What OpenCV ml learned, read back into our scorers, says what OpenCV says.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/ml.hpp>
#include <random>

#include "core/ml/learn.hpp"
#include "core/ml/train_opencv.hpp"
#include "learning_world.hpp"

namespace anchord::ml::opencv_test {
namespace {

/// Two clouds that overlap, or a curved surface; values that floats hold exactly.
struct Cloud {
  std::vector<double> x, y, w;
  static constexpr std::size_t d = 3;

  Cloud(std::size_t n, bool classes, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0, 1);
    for (std::size_t i = 0; i < n; ++i) {
      const double side = i % 2 == 0 ? 0.7 : -0.7;
      double row[d];
      for (std::size_t j = 0; j < d; ++j) {
        row[j] = static_cast<float>(noise(random) + (j == 0 ? side : 0.0));
        x.push_back(row[j]);
      }
      y.push_back(classes ? (side > 0 ? 1.0 : 0.0)
                          : static_cast<float>(0.3 * row[0] + 0.1 * row[1] * row[1] + 0.02 * noise(random)));
      w.push_back(1);
    }
  }
  TrainingRows rows() const { return {x, d, y, w}; }
  cv::Mat samples() const {
    cv::Mat out(static_cast<int>(y.size()), static_cast<int>(d), CV_32F);
    for (std::size_t i = 0; i < x.size(); ++i) out.ptr<float>(0)[i] = static_cast<float>(x[i]);
    return out;
  }
};

/// The reference: OpenCV trained with the same settings and asked itself.
cv::Mat svm_reference(const Cloud& train, const Cloud& asked, const SvmOptions& o, bool classes, int kernel) {
  auto svm = cv::ml::SVM::create();
  svm->setType(classes ? cv::ml::SVM::C_SVC : cv::ml::SVM::EPS_SVR);
  svm->setKernel(kernel);
  svm->setC(o.c);
  svm->setGamma(o.gamma);
  svm->setCoef0(o.coef0);
  svm->setDegree(o.degree);
  if (!classes) svm->setP(o.epsilon_m);
  svm->setTermCriteria({cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 10'000'000, 1e-3});
  cv::Mat answers(static_cast<int>(train.y.size()), 1, classes ? CV_32S : CV_32F);
  for (int i = 0; i < answers.rows; ++i) {
    const double y = train.y[static_cast<std::size_t>(i)];
    if (classes)
      answers.at<int>(i) = y > 0.5 ? 1 : 0;
    else
      answers.at<float>(i) = static_cast<float>(y);
  }
  EXPECT_TRUE(svm->train(train.samples(), cv::ml::ROW_SAMPLE, answers));
  cv::Mat out;
  svm->predict(asked.samples(), out, classes ? cv::ml::StatModel::RAW_OUTPUT : 0);
  return out;
}

TEST(OpenCv, SvmsSayTheSameOnceReadBack) {
  const struct {
    Kernel ours;
    int theirs;
    double gamma, coef0;
  } kernels[]{{Kernel::linear, cv::ml::SVM::LINEAR, 1, 0},
              {Kernel::rbf, cv::ml::SVM::RBF, 0.3, 0},
              {Kernel::polynomial, cv::ml::SVM::POLY, 0.3, 1},
              {Kernel::sigmoid, cv::ml::SVM::SIGMOID, 0.05, 0.1}};
  for (const bool classes : {true, false}) {
    const Cloud train(120, classes, 1), asked(200, classes, 2);
    for (const auto& kernel : kernels) {
      SvmOptions o;
      o.kernel = kernel.ours;
      o.gamma = kernel.gamma;
      o.coef0 = kernel.coef0;
      o.c = 0.1;
      o.degree = 2;
      const auto ours = fit_svm_opencv(train.rows(), o, classes);
      ASSERT_TRUE(ours.has_value()) << ours.error().message;
      const cv::Mat theirs = svm_reference(train, asked, o, classes, kernel.theirs);
      double worst = 0;
      for (int i = 0; i < theirs.rows; ++i) {
        const double said = score(ours.value(), asked.rows().row(static_cast<std::size_t>(i)));
        // OpenCV's decision is positive for the lower label, NLOS; ours for LOS.
        worst = std::max(worst, std::abs(said - (classes ? -1 : 1) * theirs.at<float>(i)));
      }
      EXPECT_LT(worst, 1e-6) << "kernel " << kernel.theirs << (classes ? " classes" : " values");
    }
  }
}

TEST(OpenCv, ForestsSayTheSameOnceReadBack) {
  const Cloud train(300, false, 3), asked(400, false, 4);
  TreeOptions o;
  o.trees = 40;
  o.leaf_share = 0.01;
  const auto ours = fit_forest_opencv(train.rows(), o);
  ASSERT_TRUE(ours.has_value()) << ours.error().message;
  EXPECT_EQ(ours.value().roots.size(), 40u);
  cv::setNumThreads(1);
  cv::theRNG().state = o.seed * 0x9e3779b97f4a7c15U + 1;
  auto forest = cv::ml::RTrees::create();
  forest->setMaxDepth(o.max_depth);
  forest->setMinSampleCount(6);
  forest->setRegressionAccuracy(0);
  forest->setActiveVarCount(0);
  forest->setTermCriteria({cv::TermCriteria::COUNT, o.trees, 0});
  cv::Mat answers(static_cast<int>(train.y.size()), 1, CV_32F);
  for (int i = 0; i < answers.rows; ++i)
    answers.at<float>(i) = static_cast<float>(train.y[static_cast<std::size_t>(i)]);
  ASSERT_TRUE(forest->train(train.samples(), cv::ml::ROW_SAMPLE, answers));
  for (const Cloud* cloud : {&train, &asked}) {  // training rows lie on thresholds' sides by a hair
    cv::Mat theirs;
    forest->predict(cloud->samples(), theirs);
    for (int i = 0; i < theirs.rows; ++i)
      ASSERT_NEAR(score(ours.value(), cloud->rows().row(static_cast<std::size_t>(i))), theirs.at<float>(i),
                  1e-6)
          << i;
  }
}

TEST(OpenCv, TheSameRowsAndSeedGiveTheSameModel) {
  const Cloud train(200, true, 5);
  TreeOptions o;
  o.trees = 10;
  const auto first = fit_forest_opencv(train.rows(), o), second = fit_forest_opencv(train.rows(), o);
  o.seed = 2;
  const auto other = fit_forest_opencv(train.rows(), o);
  ASSERT_TRUE(first.has_value() && second.has_value() && other.has_value());
  const auto at = train.rows().row(0);
  EXPECT_EQ(first.value().nodes.size(), second.value().nodes.size());
  EXPECT_EQ(score(first.value(), at), score(second.value(), at));
  EXPECT_NE(first.value().nodes.size(), other.value().nodes.size());
}

TEST(OpenCv, RefusesWhatCannotBeLearned) {
  Cloud one_class(20, true, 6);
  std::fill(one_class.y.begin(), one_class.y.end(), 1.0);
  EXPECT_FALSE(fit_svm_opencv(one_class.rows(), {}, true).has_value());
  EXPECT_FALSE(fit_svm_opencv({}, {}, false).has_value());
  EXPECT_FALSE(fit_forest_opencv({}, {}).has_value());
  SvmOptions impossible;
  impossible.c = -1;
  const auto refused = fit_svm_opencv(Cloud(20, true, 7).rows(), impossible, true);
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().message.find("OpenCV"), std::string::npos) << refused.error().message;
}

}  // namespace
}  // namespace anchord::ml::opencv_test
