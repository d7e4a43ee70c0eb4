#pragma once

#include <string>
#include <vector>

#include "core/ml/recipe.hpp"

namespace anchord::ml {

/// What shuffling one feature costs a forest on its out-of-bag rows (6.4).
struct Importance {
  std::string feature{};
  double mean{};  ///< rise of the mean squared error (Brier for classes), share of that without shuffling
  double sd{};    ///< over the repetitions
};

/// Out-of-bag permutation importance of a random forest, most important first. Whole columns are shuffled by
/// the seed, `repeats` times. errors: those of fit_classifier
Result<std::vector<Importance>> permutation_importance(const Dataset& data, const Recipe& recipe,
                                                       bool classification, int repeats = 5,
                                                       const Execution& run = {});

/// One step of the forward filter.
struct ForwardStep {
  std::string feature{};
  double loss{};  ///< grouped log loss or MAE with this feature and those before it
  bool kept{};
};

/// Features in the order given (by importance), each kept while the grouped loss falls by more than
/// `least_gain` (6.4).
Result<std::vector<ForwardStep>> forward_filter(const Dataset& data, Recipe recipe,
                                                const std::vector<std::string>& order,
                                                const std::vector<std::size_t>& fold, bool classification,
                                                double least_gain = 0.002, const Execution& run = {});

}  // namespace anchord::ml
