#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/ml/metrics.hpp"
#include "core/ml/recipe.hpp"

/// From a data set to a model: candidates, grouped cross-validation, pick, refit on everything, calibrate.
namespace anchord::ml {

/// Values tried for each setting of each method: grid[method][setting]; settings are those of
/// `grid_settings`.
using Grid = std::map<Method, std::map<std::string, std::vector<double>>>;

/// Names of a method's settings, e.g. c, gamma, kernel (0 linear, 1 polynomial, 2 sigmoid, 3 rbf), degree,
/// coef0, epsilon_m for svm; empty for methods without any.
std::vector<std::string> grid_settings(Method method);

/// The grid `search` means for a method.
std::map<std::string, std::vector<double>> default_grid(Method method, bool classification);

/// Whether a method can learn a task: classes, or a bias in metres.
bool suits(Method method, Task task);

struct LearnOptions {
  Task task{Task::nlos_id};
  std::vector<Method> methods{};        ///< empty: auto
  Engine engine{Engine::own};           ///< opencv: `methods` names what it has
  std::vector<std::string> features{};  ///< empty: chosen with the method
  std::size_t folds{10};
  std::uint64_t seed{1};
  std::size_t per_placement{5};     ///< rows of one placement used for training
  bool search{false};               ///< search the declared grid of settings, not only the defaults
  Grid grid{};                      ///< search this one instead
  std::optional<double> max_fpr{};  ///< threshold that keeps the out-of-fold FPR at or below this
  Execution run{};
  std::function<void(double share_done, const std::string& detail)> progress{};
};

/// One candidate on places it has not seen.
struct CandidateRow {
  std::string name{};     ///< "svm(c=3, gamma=0.03) on 7 features"
  double loss{};          ///< log loss or MAE, every placement alike: what selection minimises
  double loss_sd{};       ///< over the folds
  Confusion confusion{};  ///< identification; rows, at 0.5
  double brier{};
  ErrorStats error{};     ///< bias; rows
  double worst_harm_m{};  ///< largest rise of a place's MAE over the uncorrected one
  bool picked{};
  Method method{};
  std::vector<std::pair<std::string, double>> settings{};
  std::vector<std::string> features{};
};

/// One candidate on the places of one fold.
struct FoldRow {
  std::size_t candidate{};  ///< index into the table
  std::size_t fold{};
  std::size_t train_rows{}, test_rows{};
  double loss{};
  Confusion confusion{};        ///< identification
  double mae_raw_m{}, mae_m{};  ///< bias
};

struct Learned {
  Model model{};
  Recipe picked{};                          ///< of the classifier, or of the regression without classes
  std::vector<CandidateRow> table{};        ///< bias tasks: the first row is "none (no correction)"
  std::vector<CandidateRow> class_table{};  ///< task bias with classes: the candidates of its classifier
  std::vector<FoldRow> folds{};             ///< of `table`
  std::vector<std::size_t> fold{};          ///< of each row
  std::vector<double> p_los{};              ///< out-of-fold, of each row; empty without classes
  std::vector<double> correction_m{};       ///< out-of-fold; empty for nlos_id
  double nll{}, nll_constants{};  ///< bias tasks: mean negative log-likelihood, and that of constants that
                                  ///< know neither class nor features
};

/// errors: too_few_observations (fewer than 2 groups, one class), not_found (feature), canceled
Result<Learned> learn(const Dataset& data, const LearnOptions& options);

/// The candidates that `auto` would try on these data, preferred first: a later one must be clearly better.
/// `search` and `grid` widen the settings.
std::vector<Recipe> classifier_candidates(const Dataset& data, const LearnOptions& options);
std::vector<Recipe> regressor_candidates(const Dataset& data, const LearnOptions& options);

}  // namespace anchord::ml
