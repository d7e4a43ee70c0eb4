#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/ml/metrics.hpp"
#include "core/ml/recipe.hpp"

/// From a data set to a model: candidates, grouped cross-validation, pick, refit on everything, calibrate.
namespace anchord::ml {

struct LearnOptions {
  Task task{Task::nlos_id};
  std::optional<Method> method{};       ///< absent: auto
  std::vector<std::string> features{};  ///< absent: chosen with the method
  std::size_t folds{10};
  std::uint64_t seed{1};
  std::size_t per_placement{5};     ///< rows of one placement used for training
  bool grid{false};                 ///< search the declared grid of settings, not only the defaults
  std::optional<double> max_fpr{};  ///< threshold that keeps the out-of-fold FPR at or below this
  Progress progress{};              ///< answers false to cancel
};

/// One candidate on places it has not seen.
struct CandidateRow {
  std::string name{};
  double loss{}, loss_sd{};
  Confusion confusion{};  ///< identification; rows
  double brier{};
  ErrorStats error{};  ///< bias; rows
  double worst_harm_m{};
  bool picked{};
};

struct Learned {
  Model model{};
  std::vector<CandidateRow> table{};   ///< bias tasks: the first row is "none (no correction)"
  std::vector<double> p_los{};         ///< out-of-fold, of each row; empty without classes
  std::vector<double> correction_m{};  ///< out-of-fold; empty for nlos_id
  double nll{}, nll_constants{};  ///< bias tasks: mean negative log-likelihood, and that of constants that
                                  ///< know neither class nor features
};

/// errors: too_few_observations (fewer than 2 groups, one class), not_found (feature), canceled
Result<Learned> learn(const Dataset& data, const LearnOptions& options);

/// The candidates that `auto` would try on these data, preferred first: a later one must be clearly better.
/// `grid` widens the settings.
std::vector<Recipe> classifier_candidates(const Dataset& data, const LearnOptions& options);
std::vector<Recipe> regressor_candidates(const Dataset& data, const LearnOptions& options);

}  // namespace anchord::ml
