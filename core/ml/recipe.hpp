#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"
#include "core/ml/dataset.hpp"
#include "core/ml/parallel.hpp"
#include "core/ml/train.hpp"

/// One way to fit: a method, its features and its settings; and how it does on places it has not seen.
namespace anchord::ml {

enum class Method : std::uint8_t {
  none,      ///< no correction
  constant,  ///< median bias
  logistic,
  random_forest,
  svm,
  boosted,
  average,         ///< mean of the logits of logistic, RBF SVM and forest
  univariate,      ///< polynomial of one feature
  multivariate,    ///< polynomial of several, with interactions
  least_absolute,  ///< robust linear fit
  tree_average,    ///< mean of the logits of boosted trees and forest: for many rows
};

/// What univariate was called before.
inline constexpr std::string_view k_univariate_before = "polynomial";
inline constexpr auto k_method_words = enum_table<Method>({{"none", Method::none},
                                                           {"constant", Method::constant},
                                                           {"logistic", Method::logistic},
                                                           {"random_forest", Method::random_forest},
                                                           {"svm", Method::svm},
                                                           {"boosted", Method::boosted},
                                                           {"average", Method::average},
                                                           {"univariate", Method::univariate},
                                                           {"multivariate", Method::multivariate},
                                                           {"least_absolute", Method::least_absolute},
                                                           {"tree_average", Method::tree_average}});
constexpr std::string_view method_name(Method method) { return k_method_words.word(method); }
constexpr std::optional<Method> method_of(std::string_view name) {
  return name == k_univariate_before ? Method::univariate : k_method_words.find(name);
}

/// Whose code fits: our own with libsvm, or OpenCV ml, which has SVMs and forests.
enum class Engine : std::uint8_t { own, opencv };
inline constexpr auto k_engine_words = enum_table<Engine>({{"own", Engine::own}, {"opencv", Engine::opencv}});
constexpr std::string_view engine_name(Engine engine) { return k_engine_words.word(engine); }
bool fits(Engine engine, Method method);
/// An SVM is fitted to at most so many rows: time grows with their square. OpenCV takes a quarter of the time
/// of libsvm, and the process it runs in can be ended at any moment.
std::size_t most_svm_rows(Engine engine);

struct Recipe {
  Method method{Method::average};
  Engine engine{Engine::own};
  std::vector<std::string> features{};
  double clip{3};    ///< sd, for features outside the training range; 0 off
  double c{3};       ///< logistic
  SvmOptions svm{};  ///< c counts placements, and is spread over their rows
  TreeOptions forest{};
  BoostOptions boosted{};
  int degree{2};            ///< polynomials
  bool interactions{true};  ///< multivariate: products of different features too
  double ridge{1e-3};
  std::size_t per_placement{5};  ///< rows of one placement used for training: repeats are near copies

  std::string describe() const;  ///< "svm(c=3, gamma=0.03) on 7 features"
};

/// Sets one of the method's settings by its name (grid_settings); false where the method has none of that
/// name.
bool apply_setting(Recipe& recipe, std::string_view name, double value);
/// The method's settings as they are, in the order of `grid_settings`.
std::vector<std::pair<std::string, double>> settings_of(const Recipe& recipe);
/// Every combination of the values of the axes.
std::vector<Recipe> expand(const Recipe& recipe, const std::map<std::string, std::vector<double>>& axes);

/// Uncalibrated classifier on the recipe's features. errors: not_found, too_few_observations (one class
/// only), canceled
Result<Classifier> fit_classifier(const Dataset& data, const Recipe& recipe, const Execution& run = {});
/// errors: not_found, too_few_observations
Result<Regressor> fit_regressor(const Dataset& data, const Recipe& recipe, const Execution& run = {});

/// Weight 1 / rows of the same placement for each row, so that every placement counts alike.
std::vector<double> placement_weights(const Dataset& data);

/// What models that never saw a row's place say about it.
struct OutOfFold {
  std::vector<double> logit{};  ///< classification, uncalibrated
  std::vector<double> p_los{};  ///< calibrated by one Platt line over all folds, clipped
  Platt platt{};
  std::vector<double> bias_m{};  ///< regression
  double loss{};                 ///< log loss or MAE, every placement alike: what selection minimises
  double loss_sd{};              ///< over the folds
  std::vector<double> fold_loss{};
  double worst_harm_m{};  ///< regression: largest rise of a place's MAE over the uncorrected one
};
/// fold  of each row, from grouped_folds
Result<OutOfFold> cross_validate(const Dataset& data, const Recipe& recipe,
                                 const std::vector<std::size_t>& fold, bool classification,
                                 const Execution& run = {});

/// Largest rise, metres, of any group's mean absolute error by a correction; groups of fewer than 20 rows are
/// left to noise.
double worst_harm_m(const Dataset& data, std::span<const double> correction_m);

}  // namespace anchord::ml
