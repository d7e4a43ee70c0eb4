#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/ml/evaluate.hpp"
#include "core/ml/importance.hpp"
#include "core/ml/learn.hpp"

/// A whole training run, as the command line and the service start it: split, grid search by grouped
/// cross-validation, pick, refit, threshold, importance, measurement on held-out places.
namespace anchord::ml {

/// Row fits (settings x folds x rows) of a run at most: some hours on two cores.
inline constexpr double k_most_row_fits = 1e9;

struct TrainingSpec {
  Task task{Task::nlos_id};
  std::vector<Method> methods{};  ///< empty: auto; of opencv: svm and random_forest
  Engine engine{Engine::own};
  std::vector<std::string> features{};  ///< empty: chosen with the method
  std::size_t folds{10};                ///< of whole places
  std::uint64_t seed{1};
  std::size_t per_placement{5};         ///< rows of one placement used for training: repeats are near copies
  bool search{false};                   ///< search the declared default grid of the methods
  Grid grid{};                          ///< search this grid instead
  std::vector<std::string> held_out{};  ///< places (group names) no part of training sees: the final test
  double held_out_share{0};             ///< or this share of the places, drawn by the seed
  std::optional<double> max_fpr{};      ///< threshold that keeps the out-of-fold FPR at or below this
  bool importance{true};                ///< out-of-bag permutation importance of a forest on the features
  bool selection{false};                ///< forward filter in the order of importance (6.4)
  std::size_t threads{0};               ///< 0: as many as cores; the result does not depend on it

  /// errors: invalid_argument, with every fault in the message
  Result<void> check() const;
  /// Whether the search can end within hours: settings x folds x rows, an SVM's rows at most those it is
  /// fitted to. errors: invalid_argument, with the numbers
  Result<void> check_size(std::size_t rows) const;
};

/// Where a run stands; called from the calling thread only, a few times a second at most.
struct TrainingProgress {
  std::string stage{};  ///< split, search, importance, selection, test
  std::size_t stage_index{}, stage_count{};
  double fraction{};     ///< of the whole run, never falling
  std::string detail{};  ///< "svm(c=10, gamma=0.1) on 7 features"
};
using ProgressSink = std::function<void(const TrainingProgress&)>;

/// One row as models that never saw its place judge it.
struct RowPrediction {
  std::size_t row{};  ///< index into the data set given
  bool held_out{};    ///< true: final test, by the finished model; false: out of fold
  std::optional<bool> los{};
  std::optional<double> p_los{};
  std::optional<double> bias_m{}, correction_m{};
};

/// How the rows were divided, and whether anything crossed the line.
struct SplitReport {
  std::size_t train_rows{}, train_placements{}, train_places{};
  std::size_t test_rows{}, test_placements{}, test_places{};
  std::vector<std::string> test_place_names{};
  std::size_t shared_placements{};  ///< placements with rows in more than one place
  std::size_t duplicate_rows{};  ///< rows of different places with equal values in every feature and answer
  bool leak{};                   ///< either of the two
};

/// What a threshold costs, and how sure the FPR is.
struct ThresholdReport {
  double threshold{0.5};
  std::optional<double> max_fpr{};      ///< asked for
  double fpr{}, fpr_low{}, fpr_high{};  ///< out of fold; 95 % interval by resampling whole places
  double accuracy{}, accuracy_at_half{};
  std::size_t places{};  ///< with NLOS rows: few means the interval itself is rough
};

struct TrainingOutcome {
  Model model{};
  std::vector<CandidateRow> candidates{};  ///< the grid; bias tasks: the first is "none (no correction)"
  std::vector<CandidateRow> class_candidates{};         ///< task bias with classes: those of its classifier
  std::vector<FoldRow> folds{};                         ///< of `candidates`
  std::vector<std::vector<std::string>> fold_places{};  ///< names of the places each fold held out
  std::vector<Importance> importance{};
  std::vector<ForwardStep> selection{};
  std::optional<Confusion> confusion{};  ///< out of fold, at the model's threshold
  std::vector<RocPoint> roc{};
  std::optional<double> auc{};
  std::optional<ThresholdReport> threshold{};
  std::optional<BiasEvaluation> bias{};  ///< out of fold
  std::vector<CdfPoint> cdf_raw{}, cdf_corrected{};
  std::optional<double> nll{}, nll_constants{};  ///< mean negative log-likelihood of the bias, out of fold
  std::vector<RowPrediction> predictions{};
  std::optional<Evaluation> test{};  ///< of the finished model on the held-out places
  SplitReport split{};
};

/// Rows to train on and rows held out: whole places, by name or a share of them drawn by the seed.
struct PlaceSplit {
  std::vector<std::size_t> train{}, test{};
};
/// errors  not_found (a place), too_few_observations (nothing left to train on)
Result<PlaceSplit> split_places(const Dataset& data, const std::vector<std::string>& held_out,
                                double held_out_share, std::uint64_t seed);

SplitReport split_report(const Dataset& data, const std::vector<std::size_t>& train,
                         const std::vector<std::size_t>& test);

/// `p_los` out of fold, of each row of `data`.
ThresholdReport threshold_report(const Dataset& data, std::span<const double> p_los, double threshold,
                                 std::optional<double> max_fpr, std::uint64_t seed);

/// The same data, spec and seed give the same bytes on any number of cores.
/// stop    looked at between trees, rounds and solver steps: a run ends within half a second, and leaves
///         nothing
/// errors  canceled, too_few_observations (fewer than 2 places, one class), not_found (feature, place),
///         invalid_argument (spec)
Result<TrainingOutcome> train(const Dataset& data, const TrainingSpec& spec, std::stop_token stop = {},
                              const ProgressSink& progress = {});

}  // namespace anchord::ml
