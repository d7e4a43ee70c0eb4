#include "core/ml/train_opencv.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/ml.hpp>

namespace anchord::ml {
namespace {

/// OpenCV draws from a generator of the calling thread; folds are what runs side by side here, so its own
/// threads stay out of it.
void begin(std::uint64_t seed) {
  static const bool alone = (cv::setNumThreads(1), true);
  (void)alone;
  cv::theRNG().state = seed;
}

Error refused(const cv::Exception& fault) {
  return make_error(Errc::invalid_argument, "OpenCV: " + std::string(fault.err.c_str()));
}

int kernel_of(Kernel kernel) {
  switch (kernel) {
    case Kernel::linear:
      return cv::ml::SVM::LINEAR;
    case Kernel::polynomial:
      return cv::ml::SVM::POLY;
    case Kernel::sigmoid:
      return cv::ml::SVM::SIGMOID;
    case Kernel::rbf:
      return cv::ml::SVM::RBF;
  }
  return cv::ml::SVM::RBF;
}

/// `n` of the rows, drawn evenly; itself where all are taken.
cv::Mat samples_of(const TrainingRows& rows, std::size_t n) {
  cv::Mat out(static_cast<int>(n), static_cast<int>(rows.d), CV_32F);
  for (std::size_t i = 0; i < n; ++i) {
    const auto row = rows.row((2 * i + 1) * rows.n() / (2 * n));
    auto* to = out.ptr<float>(static_cast<int>(i));
    for (std::size_t j = 0; j < rows.d; ++j) to[j] = static_cast<float>(row[j]);
  }
  return out;
}

cv::Ptr<cv::ml::SVM> trained_svm(const TrainingRows& rows, std::size_t n, const SvmOptions& options,
                                 bool classification) {
  const cv::Mat samples = samples_of(rows, n);
  cv::Mat answers(static_cast<int>(n), 1, classification ? CV_32S : CV_32F);
  for (std::size_t i = 0; i < n; ++i) {
    const double y = rows.y[(2 * i + 1) * rows.n() / (2 * n)];
    if (classification)
      answers.at<int>(static_cast<int>(i)) = y > 0.5 ? 1 : 0;
    else
      answers.at<float>(static_cast<int>(i)) = static_cast<float>(y);
  }
  auto svm = cv::ml::SVM::create();
  svm->setType(classification ? cv::ml::SVM::C_SVC : cv::ml::SVM::EPS_SVR);
  svm->setKernel(kernel_of(options.kernel));
  svm->setC(options.c);
  svm->setGamma(options.gamma);
  svm->setCoef0(options.coef0);
  svm->setDegree(options.degree);
  if (!classification) svm->setP(options.epsilon_m);
  // Its own default of 1000 steps ends a fit of some hundred rows half-way.
  svm->setTermCriteria({cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 10'000'000, 1e-3});
  return svm->train(samples, cv::ml::ROW_SAMPLE, answers) ? svm : cv::Ptr<cv::ml::SVM>();
}

}  // namespace

Result<Svm> fit_svm_opencv(const TrainingRows& rows, const SvmOptions& options, bool classification) {
  const std::size_t n = std::min(rows.n(), std::max<std::size_t>(options.max_rows, 1));
  if (n == 0) return make_error(Errc::too_few_observations, "an SVM needs rows, got none");
  const auto los = [](double y) { return y > 0.5; };
  if (classification && (std::ranges::all_of(rows.y, los) || std::ranges::none_of(rows.y, los)))
    return make_error(Errc::too_few_observations, "an SVM needs rows of both classes");
  begin(1);
  try {
    const auto fitted = trained_svm(rows, n, options, classification);
    if (!fitted) return make_error(Errc::no_convergence, "OpenCV: the SVM was not trained");
    // Linear ones come back as the one vector they are.
    const cv::Mat support = fitted->getSupportVectors();
    cv::Mat alpha, index;
    const double rho = fitted->getDecisionFunction(0, alpha, index);
    Svm out{options.kernel, options.gamma, options.coef0, options.degree, rows.d, {}, {}, rho};
    for (int i = 0; i < static_cast<int>(alpha.total()); ++i) {
      const auto* vector = support.ptr<float>(index.at<int>(i));
      out.support.insert(out.support.end(), vector, vector + rows.d);
      out.alpha.push_back(alpha.at<double>(i));
    }
    // The decision of classes is positive for the lower label, which is NLOS.
    if (classification) {
      for (double& a : out.alpha) a = -a;
      out.rho = -out.rho;
    }
    return out;
  } catch (const cv::Exception& fault) {
    return refused(fault);
  }
}

Result<Trees> fit_forest_opencv(const TrainingRows& rows, const TreeOptions& options) {
  if (rows.n() < 2) return make_error(Errc::too_few_observations, "a forest needs rows");
  begin(options.seed * 0x9e3779b97f4a7c15U + 1);
  try {
    const cv::Mat samples = samples_of(rows, rows.n());
    cv::Mat answers(static_cast<int>(rows.n()), 1, CV_32F);
    for (std::size_t i = 0; i < rows.n(); ++i)
      answers.at<float>(static_cast<int>(i)) = static_cast<float>(rows.y[i]);
    auto forest = cv::ml::RTrees::create();
    forest->setMaxDepth(options.max_depth);
    // Splits a node of at least this many; ours bounds the leaf, which is half of it.
    forest->setMinSampleCount(
        std::max(2, static_cast<int>(std::lround(2 * options.leaf_share * static_cast<double>(rows.n())))));
    forest->setRegressionAccuracy(0);
    forest->setActiveVarCount(static_cast<int>(options.features_per_split));  // 0: the root of their number
    forest->setTermCriteria({cv::TermCriteria::COUNT, options.trees, 0});
    if (!forest->train(samples, cv::ml::ROW_SAMPLE, answers))
      return make_error(Errc::no_convergence, "OpenCV: the forest was not trained");
    Trees out;
    const auto& nodes = forest->getNodes();
    const auto& splits = forest->getSplits();
    out.scale = 1.0 / static_cast<double>(forest->getRoots().size());
    struct Todo {
      int theirs;
      std::size_t ours;
    };
    for (const int root : forest->getRoots()) {
      out.roots.push_back(static_cast<std::uint32_t>(out.nodes.size()));
      out.nodes.emplace_back();
      std::vector<Todo> todo{{root, out.nodes.size() - 1}};
      while (!todo.empty()) {
        const Todo at = todo.back();
        todo.pop_back();
        const auto& node = nodes[static_cast<std::size_t>(at.theirs)];
        if (node.split < 0) {
          out.nodes[at.ours].value = node.value;
          continue;
        }
        const auto& split = splits[static_cast<std::size_t>(node.split)];
        const std::size_t left = out.nodes.size();
        out.nodes.resize(left + 2);
        // Theirs goes left up to and including c, ours below the threshold.
        out.nodes[at.ours] = {
            split.varIdx, static_cast<std::uint32_t>(left),
            std::nextafter(static_cast<double>(split.c), std::numeric_limits<double>::infinity())};
        todo.push_back({split.inversed ? node.right : node.left, left});
        todo.push_back({split.inversed ? node.left : node.right, left + 1});
      }
    }
    return out;
  } catch (const cv::Exception& fault) {
    return refused(fault);
  }
}

}  // namespace anchord::ml
