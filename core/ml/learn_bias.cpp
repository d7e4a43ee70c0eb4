#include "core/ml/learn_bias.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace anchord::ml {
namespace {

// A no-harm pick is taken where it keeps this share of what the best one saves.
constexpr double k_kept_saving = 0.5;
// Nats of mean likelihood within which the tail that corrects best is taken: a few dozen places tell no
// finer.
constexpr double k_likely = 0.15;
constexpr std::array<double, 5> k_quantiles{0.2, 0.3, 0.4, 0.5, 0.6};
constexpr std::array<double, 5> k_gains{0, 0.25, 0.5, 0.75, 1};

struct Shape {
  std::vector<std::string> shared{};
  double kappa{};
  std::vector<std::string> tail{};  // what the mean NLOS delay depends on
};

std::vector<std::size_t> indices_of(const Dataset& data, const std::vector<std::string>& names) {
  std::vector<std::size_t> out;
  for (const auto& name : names) {
    const auto at = std::find(data.features.begin(), data.features.end(), name);
    if (at != data.features.end()) out.push_back(static_cast<std::size_t>(at - data.features.begin()));
  }
  return out;
}

// Rows thinned as in training, with their out-of-fold probabilities.
Result<BiasMixture> fit_on(const Dataset& data, const std::vector<double>& p_los,
                           const std::vector<std::size_t>& rows, const Shape& shape) {
  Dataset part = data.subset(rows);
  // The probability rides along as a column through the thinning.
  part.features.emplace_back("p_los");
  std::vector<double> x;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto from = data.row(rows[i]);
    x.insert(x.end(), from.begin(), from.end());
    x.push_back(p_los[rows[i]]);
  }
  part.x = std::move(x);
  part = thin_placements(part, 5);
  std::vector<double> p;
  for (std::size_t i = 0; i < part.rows(); ++i) p.push_back(part.row(i).back());
  MixtureTask task{part.x,
                   part.columns(),
                   part.bias_m,
                   part.weight,
                   p,
                   part.los,
                   indices_of(data, shape.shared),
                   indices_of(data, shape.tail),
                   shape.kappa};
  return fit_mixture(task);
}

// Each row's density by a mixture fitted to the other folds.
Result<std::vector<BiasDensity>> out_of_fold(const Dataset& data, const std::vector<double>& p_los,
                                             const std::vector<std::size_t>& fold, const Shape& shape,
                                             const Execution& run) {
  const std::size_t folds = *std::max_element(fold.begin(), fold.end()) + 1;
  std::vector<BiasDensity> out(data.rows());
  BOOST_OUTCOME_TRY(parallel_for(folds, run, [&](std::size_t k) -> Result<void> {
    BOOST_OUTCOME_TRY(const auto mixture, fit_on(data, p_los, rows_of_fold(fold, k, false), shape));
    for (const auto i : rows_of_fold(fold, k, true)) out[i] = density_of(mixture, p_los[i], data.row(i));
    return boost::outcome_v2::success();
  }));
  return out;
}

double mean_nll(const Dataset& data, const std::vector<BiasDensity>& densities,
                const std::vector<double>& weight) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < data.rows(); ++i) {
    sum -= weight[i] * densities[i].log_density(data.bias_m[i]);
    total += weight[i];
  }
  return sum / total;
}

// What the mean NLOS delay may depend on. Excess goes with what the wall took from the level, and with how
// much wall there is along the way; which of them carries over is a matter of the building and the radio.
const std::vector<std::vector<std::string>> k_tails{{"rx_free_space_db", "rx_minus_fp_db"},
                                                    {"rx_dbm", "range_m"},
                                                    {"range_m", "rx_minus_fp_db"},
                                                    {"rx_dbm", "rx_minus_fp_db"},
                                                    {"fp_dbm", "range_m"}};

// Each row's density by one of the tails, from folds without it.
struct Tail {
  std::vector<std::string> features{};
  std::vector<BiasDensity> densities{};
  double nll{};
};

// The tails worth a look, the likeliest on held-out places first: one that is clearly less likely than
// another, or than constants, would serve the estimator badly, however well its median corrects.
Result<std::vector<Tail>> likely_tails(const Dataset& data, const std::vector<double>& p_los,
                                       const std::vector<std::size_t>& fold, const Shape& shape,
                                       double nll_constants, const LearnOptions& options) {
  const auto weight = placement_weights(data);
  std::vector<Tail> out;
  for (std::size_t t = 0; t < k_tails.size(); ++t) {
    if (options.progress)
      options.progress(0.4 + 0.6 * static_cast<double>(t) / static_cast<double>(k_tails.size()),
                       "bias mixture");
    Shape one = shape;
    one.tail = k_tails[t];
    if (indices_of(data, one.tail).size() != one.tail.size() && t > 0) continue;
    BOOST_OUTCOME_TRY(auto densities, out_of_fold(data, p_los, fold, one, options.run));
    const double nll = mean_nll(data, densities, weight);
    out.push_back({std::move(one.tail), std::move(densities), nll});
  }
  std::stable_sort(out.begin(), out.end(), [](const Tail& a, const Tail& b) { return a.nll < b.nll; });
  const double most = std::max(out.front().nll, std::min(out.front().nll + k_likely, nll_constants));
  std::erase_if(out, [most](const Tail& one) { return one.nll > most; });
  return out;
}

// Grouped error of the shared curve alone, on LOS rows.
Result<double> los_loss(const Dataset& data, const std::vector<std::size_t>& fold, const Shape& shape) {
  const std::size_t folds = *std::max_element(fold.begin(), fold.end()) + 1;
  const auto weight = placement_weights(data);
  double sum = 0, total = 0;
  for (std::size_t k = 0; k < folds; ++k) {
    Dataset train = data.subset(rows_of_fold(fold, k, false));
    train = thin_placements(train, 5);
    MixtureTask task{
        train.x, train.columns(), train.bias_m, train.weight, {}, train.los, indices_of(data, shape.shared),
        {},      shape.kappa};
    BOOST_OUTCOME_TRY(const auto shared, fit_shared_bias(task));
    BiasMixture m;
    m.shared = shared;
    for (const auto i : rows_of_fold(fold, k, true)) {
      if (!data.los[i]) continue;
      sum += weight[i] * std::abs(data.bias_m[i] - m.shared_m(data.row(i)));
      total += weight[i];
    }
  }
  return sum / std::max(total, 1e-12);
}

// One way to correct, and what it costs on held-out places.
struct Choice {
  std::size_t row{}, tail{};
  double quantile{}, gain{}, cost{};
  std::vector<double> correction_m{};
};

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const auto& name : names) out += (out.empty() ? "" : " and ") + name;
  return out;
}

std::string fixed(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f", value);
  return text.data();
}

CandidateRow bias_row(const Dataset& data, std::string name, const std::vector<double>& correction) {
  CandidateRow row;
  row.name = std::move(name);
  std::vector<double> left;
  for (std::size_t i = 0; i < data.rows(); ++i) left.push_back(data.bias_m[i] - correction[i]);
  row.error = error_stats(left);
  row.loss = row.error.mae_m;
  row.worst_harm_m = worst_harm_m(data, correction);
  return row;
}

// The comparison of the literature: medians of the two classes, weighted by the probability.
std::vector<double> weighted_class_medians(const Dataset& data, const std::vector<double>& p_los,
                                           const std::vector<std::size_t>& fold) {
  std::vector<double> out(data.rows());
  const auto weight = placement_weights(data);
  const std::size_t folds = *std::max_element(fold.begin(), fold.end()) + 1;
  for (std::size_t k = 0; k < folds; ++k) {
    std::vector<std::pair<double, double>> los, nlos;
    for (const auto i : rows_of_fold(fold, k, false))
      (data.los[i] ? los : nlos).emplace_back(data.bias_m[i], weight[i]);
    const double a = weighted_median(std::move(los)), b = weighted_median(std::move(nlos));
    for (const auto i : rows_of_fold(fold, k, true)) out[i] = p_los[i] * a + (1 - p_los[i]) * b;
  }
  return out;
}

/// Asks whether to stop, and says where the work is.
bool cancelled(const LearnOptions& options, const char* stage, double share) {
  if (options.progress) options.progress(share, stage);
  return options.run.cancelled();
}

/// Shared curve by held-out LOS rows; a constant unless a curve is clearly better.
Result<Shape> choose_curve(const Dataset& data, const LearnOptions& options,
                           const std::vector<std::size_t>& fold) {
  Shape best;
  BOOST_OUTCOME_TRY(double best_loss, los_loss(data, fold, best));
  for (const auto& names : {std::vector<std::string>{"range_m", "range_db"},
                            std::vector<std::string>{"range_m", "fp_dbm", "noise_excess_db"}}) {
    if (indices_of(data, names).size() != names.size()) continue;
    for (const double kappa : {0.5, 1.0}) {
      if (cancelled(options, "shared bias", 0.2)) return make_error(Errc::canceled, "cancelled");
      BOOST_OUTCOME_TRY(const double loss, los_loss(data, fold, {names, kappa, {}}));
      if (loss < best_loss * 0.98) {
        best_loss = loss;
        best = {names, kappa, {}};
      }
    }
  }
  return best;
}

double los_share(const Dataset& data, const std::vector<double>& weight) {
  double los = 0, total = 0;
  for (std::size_t i = 0; i < data.rows(); ++i) {
    los += weight[i] * data.los[i];
    total += weight[i];
  }
  return los / total;
}

/// What was tried, and the two that may be used.
struct Tried {
  std::vector<CandidateRow> table;
  Choice harmless, priced;

  double mae_m(const Choice& choice) const { return table[choice.row].error.mae_m; }
  /// The saving of the harmless one is most of what there is.
  bool no_harm() const {
    const double raw = table.front().error.mae_m;
    return raw - mae_m(harmless) >= k_kept_saving * (raw - mae_m(priced));
  }
};

/// Which tail, and how much of it to apply: the least mean error among those that do no place more than 2 cm
/// of harm. Where that would throw most of the saving away, the harm is priced instead. Nothing at all is
/// among the choices.
Tried try_tails(const Dataset& data, const std::vector<double>& p_los, const std::vector<std::size_t>& fold,
                const std::vector<Tail>& tails) {
  Tried out;
  out.table = {bias_row(data, "none (no correction)", std::vector<double>(data.rows(), 0.0)),
               bias_row(data, "class medians weighted by P(LOS)", weighted_class_medians(data, p_los, fold))};
  const double raw_mae = out.table.front().error.mae_m;
  out.harmless = out.priced = Choice{0, 0, 0.5, 0, raw_mae, {}};
  for (std::size_t t = 0; t < tails.size(); ++t) {
    for (const double q : k_quantiles) {
      std::vector<double> whole;
      for (const auto& density : tails[t].densities) whole.push_back(density.quantile(q));
      for (const double gain : k_gains) {
        if (gain == 0) continue;
        std::vector<double> correction;
        for (const double v : whole) correction.push_back(gain * v);
        out.table.push_back(bias_row(
            data,
            "mixture of " + joined(tails[t].features) + ", quantile " + fixed(q) + ", gain " + fixed(gain),
            correction));
        const auto& row = out.table.back();
        const double cost = row.error.mae_m + k_harm_price * std::max(0.0, row.worst_harm_m - k_harmless_m);
        const Choice one{out.table.size() - 1, t, q, gain, cost, std::move(correction)};
        // A less likely tail must correct clearly better.
        const auto better = [&](const Choice& than) {
          return cost < (than.tail == t ? than.cost : 0.99 * than.cost) - 1e-4;
        };
        if (row.worst_harm_m <= k_harmless_m && better(out.harmless)) out.harmless = one;
        if (better(out.priced)) out.priced = one;
      }
    }
  }
  return out;
}

/// The mixture that is deployed, on every row. The model sees the classifier's own feature columns, so the
/// mixture's names join them.
Result<BiasMixture> fit_deployed(const Dataset& data, const Shape& shape, Learned& out) {
  std::vector<std::size_t> all(data.rows());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  std::vector<std::string>& features = out.model.info.features;
  std::vector<std::string> wanted = shape.shared;
  wanted.insert(wanted.end(), shape.tail.begin(), shape.tail.end());
  for (const auto& name : wanted)
    if (!indices_of(data, {name}).empty() &&
        std::find(features.begin(), features.end(), name) == features.end())
      features.push_back(name);
  BOOST_OUTCOME_TRY(const auto narrowed, data.with_features(features));
  return fit_on(narrowed, out.p_los, all, shape);
}

void explain(const Shape& shape, const Choice& best, const Tried& tried, Learned& out) {
  auto& info = out.model.info;
  info.why +=
      "; bias: mixture, shared curve " +
      (shape.shared.empty() ? std::string{"constant"}
                            : "of " + shape.shared.front() + " and others, kappa " + fixed(shape.kappa)) +
      "; late by " + joined(shape.tail) + "; quantile " + fixed(best.quantile) + " and gain " +
      fixed(best.gain) +
      (tried.no_harm() ? " had the least held-out error of those that harm no place by more than 2 cm"
                       : " had the least held-out error with harm beyond 2 cm priced in");
  const auto raw = tried.table.front().error, corrected = tried.table[best.row].error;
  info.metrics.insert(info.metrics.end(), {{"mae_raw_m", raw.mae_m},
                                           {"mae_m", corrected.mae_m},
                                           {"mse_raw_m2", raw.mse_m2},
                                           {"mse_m2", corrected.mse_m2},
                                           {"worst_place_harm_m", tried.table[best.row].worst_harm_m},
                                           {"nll", out.nll},
                                           {"nll_constants", out.nll_constants}});
}

}  // namespace

Result<Learned> learn_bias_mixture(const Dataset& data, const LearnOptions& options,
                                   const std::vector<std::size_t>& fold) {
  LearnOptions identify = options;
  identify.task = Task::nlos_id;
  BOOST_OUTCOME_TRY(auto out, learn_class(data, identify, fold));
  BOOST_OUTCOME_TRY(auto shape, choose_curve(data, options, fold));

  // Every row's density from folds without it; the likelihood beside that of constants.
  const auto weight = placement_weights(data);
  const std::vector<double> base_rate(data.rows(), los_share(data, weight));
  if (cancelled(options, "constants", 0.3)) return make_error(Errc::canceled, "cancelled");
  BOOST_OUTCOME_TRY(const auto constants, out_of_fold(data, base_rate, fold, {}, options.run));
  out.nll_constants = mean_nll(data, constants, weight);
  BOOST_OUTCOME_TRY(const auto tails, likely_tails(data, out.p_los, fold, shape, out.nll_constants, options));

  Tried tried = try_tails(data, out.p_los, fold, tails);
  Choice best = tried.no_harm() ? tried.harmless : tried.priced;
  shape.tail = tails[best.tail].features;
  out.nll = tails[best.tail].nll;
  out.correction_m = std::move(best.correction_m);
  if (out.correction_m.empty()) out.correction_m.assign(data.rows(), 0.0);
  BOOST_OUTCOME_TRY(auto mixture, fit_deployed(data, shape, out));
  mixture.quantile = best.quantile;
  mixture.gain = best.gain;
  explain(shape, best, tried, out);
  out.model.mixture = std::move(mixture);
  out.class_table = std::move(out.table);
  out.table = std::move(tried.table);
  out.table[best.row].picked = true;
  out.folds.clear();
  return out;
}

}  // namespace anchord::ml
