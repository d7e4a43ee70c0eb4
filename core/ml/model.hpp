#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/ml/mixture.hpp"

/// Fitted models as plain values, and their prediction: flat, free of allocation, equal on every machine that
/// computes IEEE doubles.
namespace anchord::ml {

/// No model may look at more; keeps prediction on the stack.
inline constexpr std::size_t k_max_features = 64;

/// x' = (x - mean) / sd (eq 6.4), then clipped to +-clip; clip 0: not clipped.
struct Scaler {
  std::vector<double> mean{}, sd{};
  double clip{0};
  void apply(std::span<const double> in, std::span<double> out) const;
};

struct Linear {
  std::vector<double> weights{};
  double offset{};
};

/// Sum of coefficient times product of features; a term names each feature as often as its power, and none
/// for the constant.
struct Polynomial {
  struct Term {
    std::vector<std::uint16_t> features{};
    double coefficient{};
  };
  std::vector<Term> terms{};
};

/// Trees in one array: left child `left`, right child `left + 1`; x < threshold goes left. Sum of leaf values
/// times scale, plus base.
struct Trees {
  struct Node {
    std::int32_t feature{-1};  ///< -1: leaf
    std::uint32_t left{};      ///< > own index, so that every walk ends
    double value{};            ///< threshold, or the leaf's value
  };
  std::vector<Node> nodes{};
  std::vector<std::uint32_t> roots{};
  double base{};
  double scale{1};
};

enum class Kernel : std::uint8_t { linear, polynomial, sigmoid, rbf };
inline constexpr auto k_kernel_words = enum_table<Kernel>({{"linear", Kernel::linear},
                                                           {"polynomial", Kernel::polynomial},
                                                           {"sigmoid", Kernel::sigmoid},
                                                           {"rbf", Kernel::rbf}});

/// sum_i alpha_i K(s_i, x) - rho, with libsvm's kernels: (g u'v + c)^d, tanh(g u'v + c), exp(-g |u - v|^2).
struct Svm {
  Kernel kernel{Kernel::rbf};
  double gamma{}, coef0{};
  int degree{3};
  std::size_t dims{};
  std::vector<double> support{};  ///< n x dims
  std::vector<double> alpha{};    ///< n
  double rho{};
};

using Scorer = std::variant<Linear, Polynomial, Trees, Svm>;

/// Which of them a Scorer is.
enum class ScorerKind : std::uint8_t { linear, polynomial, trees, svm };
inline constexpr auto k_scorer_words = enum_table<ScorerKind>({{"linear", ScorerKind::linear},
                                                               {"polynomial", ScorerKind::polynomial},
                                                               {"trees", ScorerKind::trees},
                                                               {"svm", ScorerKind::svm}});

/// Raw score at standardised features.
double score(const Scorer& scorer, std::span<const double> x);

/// P(LOS) = clip(sigmoid(a * mean over members of logit + b)); a member's logit is slope * s + offset, where
/// s is its score, or the log odds of its score when that is a share (forest).
struct Classifier {
  struct Member {
    Scorer scorer{};
    bool share{};  ///< score is a probability
    double slope{1}, offset{0};
  };
  Scaler scaler{};
  std::vector<Member> members{};
  double slope{1}, offset{0};  ///< calibration of the mean logit (Platt), fitted on out-of-fold predictions
  double p_min{0.01}, p_max{0.99};  ///< no model knows more than that about an unseen place
  double threshold{0.5};            ///< p >= threshold is called LOS

  double mean_logit(std::span<const double> features) const;
  double p_los(std::span<const double> features) const;
};

/// Bias in metres of one class (or of all ranges), and the spread of what it leaves.
struct Regressor {
  Scaler scaler{};
  Scorer scorer{};
  double min_m{-1e9}, max_m{1e9};  ///< answers are clipped to what was seen in training
  double fallback_m{
      0};  ///< median of the training biases: far from the training rows the answer shrinks to it
  double sigma_m{1};

  double bias_m(std::span<const double> features) const;
};

enum class Task : std::uint8_t { nlos_id, los_bias, nlos_bias, bias };
inline constexpr auto k_task_words = enum_table<Task>({{"nlos_id", Task::nlos_id},
                                                       {"los_bias", Task::los_bias},
                                                       {"nlos_bias", Task::nlos_bias},
                                                       {"bias", Task::bias}});
constexpr std::string_view task_name(Task task) { return k_task_words.word(task); }

/// Where a model comes from.
struct ModelInfo {
  Task task{Task::nlos_id};
  std::string method{};
  std::string feature_set{};            ///< version of the named features
  std::vector<std::string> features{};  ///< needed, in this order
  std::string data_digest{};
  std::size_t rows{}, placements{}, groups{};
  std::string group_by{};
  std::size_t folds{};
  std::uint64_t seed{};
  std::string code_version{};
  std::string why{};  ///< how the method was picked
  /// Why it misleads on single ranges, as live ones are: trained on means or medians. Empty: it may judge
  /// them.
  std::string not_for_live{};
  std::vector<std::pair<std::string, double>>
      metrics{};  ///< of the cross-validation, in the order of the table
};

struct Model {
  ModelInfo info{};
  std::optional<Classifier> classifier{};
  std::optional<Regressor> regressor{};  ///< los_bias, nlos_bias, or bias without classes
  std::optional<BiasMixture> mixture{};  ///< bias with classes: needs the classifier
};

struct Prediction {
  std::optional<bool> los{};
  std::optional<double> p_los{};
  std::optional<double> bias_m{};   ///< subtract from the measured range
  std::optional<double> sigma_m{};  ///< of the corrected range
};

/// features  model.info.features.size() values in that order, finite
/// threads   pure
Prediction predict(const Model& model, std::span<const double> features);

/// ln of the density of the range's bias under the model: what a robust estimator weighs. No value for a pure
/// classifier.
std::optional<double> log_density(const Model& model, std::span<const double> features, double bias_m);

}  // namespace anchord::ml
