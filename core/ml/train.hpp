#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/result.hpp"
#include "core/ml/model.hpp"
#include "core/ml/parallel.hpp"

/// Fits of the single methods. All take standardised features row after row, and are deterministic: same
/// input, same bytes. Those that may take long look at `run` between trees, rounds and solver steps; a fit
/// that was stopped returns what it has, and the caller throws it away.
namespace anchord::ml {

/// n rows of d features; y a class (1 LOS, 0 NLOS) or metres; w > 0.
struct TrainingRows {
  std::span<const double> x{};
  std::size_t d{};
  std::span<const double> y{};
  std::span<const double> w{};
  std::size_t n() const { return y.size(); }
  std::span<const double> row(std::size_t i) const { return x.subspan(i * d, d); }
};

/// Weighted mean and sd of each column; a constant column gets sd 1.
Scaler fit_scaler(std::span<const double> x, std::size_t d, std::span<const double> w, double clip);

/// L2 logistic regression by iteratively reweighted least squares: minimises sum w loss + |weights|^2 / (2
/// C).
Linear fit_logistic(const TrainingRows& rows, double c);

struct Platt {
  double slope{1}, offset{0};
};
/// Logistic of one variable: calibrates a score into log odds; slope never negative.
Platt fit_platt(std::span<const double> score, std::span<const double> y, std::span<const double> w);

/// Terms of a polynomial: every product of at most `degree` features; without interactions only powers of one
/// feature.
std::vector<Polynomial::Term> polynomial_terms(std::size_t d, int degree, bool interactions);
/// Coefficients by ridge least squares (`ridge` times the sum of weights; the constant is free).
Polynomial fit_polynomial(const TrainingRows& rows, std::vector<Polynomial::Term> terms, double ridge);

/// Linear fit of the least absolute deviation with an L1 penalty, by iteratively reweighted least squares
/// (100 rounds).
Linear fit_least_absolute(const TrainingRows& rows, double l1_penalty);

struct TreeOptions {
  int trees = 120;
  int max_depth = 30;
  double leaf_share = 0.03;            ///< of the rows; a leaf has at least this and at least one
  std::size_t features_per_split = 0;  ///< 0: sqrt of the number of features
  std::uint64_t seed = 1;
};
/// Random forest: bagged trees on up to 255 quantile bins a feature, variance criterion (Gini for classes).
/// `out_of_bag`, where given, gets for each row the mean of the trees that did not see it (NaN where all saw
/// it).
Trees fit_forest(const TrainingRows& rows, const TreeOptions& options,
                 std::vector<double>* out_of_bag = nullptr, const Execution& run = {});

struct BoostOptions {
  int rounds = 400;
  int depth = 6;
  double learning_rate = 0.05;
  double lambda = 2;  ///< L2 on leaf values
  /// Sum of second derivatives in a leaf. Rows of a placement weigh little and certain rows less, so a bound
  /// that bites here stops learning in small campaigns; `min_rows` keeps the leaves honest instead.
  double min_child_weight = 0.02;
  double min_rows = 10;        ///< in a leaf
  double row_share = 0.7;      ///< of the rows, drawn per tree
  double column_share = 0.5;   ///< of the features, drawn per tree
  bool classification = true;  ///< log loss; else squared error
  std::uint64_t seed = 1;
};
/// Gradient boosted trees, second order, on the same bins. Classification scores are log odds.
Trees fit_boosted(const TrainingRows& rows, const BoostOptions& options, const Execution& run = {});

struct SvmOptions {
  Kernel kernel = Kernel::rbf;
  double c = 3;
  double gamma = 0.03;
  double coef0 = 0;
  int degree = 3;
  double epsilon_m = 0.01;  ///< tube of the regression
  /// Fitted to this many rows at most, drawn evenly: time grows with their square, and a fit must end within
  /// half a second or so of being told to stop.
  std::size_t max_rows = 4000;
};
/// C-SVC or epsilon-SVR by libsvm; instance weights are not used (keep rows per placement equal instead). A
/// score above 0 is LOS.
Result<Svm> fit_svm(const TrainingRows& rows, const SvmOptions& options, bool classification,
                    const Execution& run = {});

/// Maximum likelihood of the bias mixture's shared curve and components. errors: too_few_observations below 8
/// rows of a class x      raw features, n rows of d p_los  out-of-fold and calibrated: in-sample
/// probabilities make the mixture overconfident
struct MixtureTask {
  std::span<const double> x{};
  std::size_t d{};
  std::span<const double> bias_m{};
  std::span<const double> w{};
  std::span<const double> p_los{};
  std::span<const std::uint8_t> los{};
  std::vector<std::size_t> shared_features{};  ///< arguments of b0; empty: constant
  std::vector<std::size_t> tail_features{};    ///< X and D
  double kappa{0};
};
Result<BiasMixture> fit_mixture(const MixtureTask& task);
/// Its first step alone: the curve b0 both classes share, from the LOS rows. errors: too_few_observations
/// below 8 of them
Result<BiasMixture::Shared> fit_shared_bias(const MixtureTask& task);

double weighted_median(std::vector<std::pair<double, double>> value_and_weight);

}  // namespace anchord::ml
