#include "core/ml/evaluate.hpp"

#include <cmath>
#include <map>

namespace anchord::ml {
namespace {

constexpr double k_sigmas95 = 1.959963984540054;

BiasEvaluation bias_of(const std::vector<double>& raw, const std::vector<double>& left,
                       const std::vector<std::size_t>& rows) {
  std::vector<double> a, b;
  for (const auto i : rows) {
    a.push_back(raw[i]);
    b.push_back(left[i]);
  }
  return {error_stats(a), error_stats(b)};
}

std::vector<std::size_t> rows_where(const Dataset& data, std::uint8_t is_los) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < data.rows(); ++i)
    if (data.los[i] == is_los) rows.push_back(i);
  return rows;
}

}  // namespace

Evaluation evaluate(const Model& model, const Dataset& given) {
  const bool one_class =
      given.labelled() && (model.info.task == Task::los_bias || model.info.task == Task::nlos_bias);
  const Dataset data = one_class ? given.of_class(model.info.task == Task::los_bias) : given;
  Evaluation out;
  out.rows = data.rows();
  std::vector<double> p_los, left;
  double nll = 0;
  std::size_t n_claimed = 0, n_within = 0;
  for (std::size_t i = 0; i < data.rows(); ++i) {
    const auto prediction = predict(model, data.row(i));
    if (prediction.p_los) p_los.push_back(*prediction.p_los);
    if (prediction.bias_m && data.has_truth()) {
      left.push_back(data.bias_m[i] - *prediction.bias_m);
      nll -= log_density(model, data.row(i), data.bias_m[i]).value_or(0);
      n_claimed += prediction.sigma_m ? 1 : 0;
      n_within += prediction.sigma_m && std::abs(left.back()) <= k_sigmas95 * *prediction.sigma_m ? 1 : 0;
    }
  }
  const bool classes = data.labelled() && !p_los.empty() && p_los.size() == data.rows();
  if (classes) {
    out.confusion = confusion_at(p_los, data.los, model.classifier->threshold);
    out.brier = brier(p_los, data.los);
    out.log_loss = log_loss(p_los, data.los);
    out.roc = roc(p_los, data.los);
    out.roc_auc = area_under(out.roc);
  }
  const bool bias = !left.empty();
  if (bias) {
    std::vector<std::size_t> all(data.rows());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    out.all = bias_of(data.bias_m, left, all);
    if (data.labelled()) {
      if (const auto rows = rows_where(data, 1); !rows.empty()) out.los = bias_of(data.bias_m, left, rows);
      if (const auto rows = rows_where(data, 0); !rows.empty()) out.nlos = bias_of(data.bias_m, left, rows);
    }
    out.nll = nll / static_cast<double>(data.rows());
    if (n_claimed > 0) out.within95 = static_cast<double>(n_within) / static_cast<double>(n_claimed);
    out.cdf_raw = cdf_of_magnitude(data.bias_m);
    out.cdf_corrected = cdf_of_magnitude(left);
  }
  std::map<std::uint32_t, std::vector<std::size_t>> places;
  for (std::size_t i = 0; i < data.rows(); ++i) places[data.group[i]].push_back(i);
  if (places.size() > 1000) return out;  // no places, only rows
  for (const auto& [group, rows] : places) {
    PlaceEvaluation place{place_name(data, group), rows.size(), {}, {}};
    if (classes) {
      Confusion c;
      for (const auto i : rows) c.count(data.los[i] != 0, p_los[i] >= model.classifier->threshold);
      place.accuracy = c.accuracy();
    }
    if (bias) place.bias = bias_of(data.bias_m, left, rows);
    out.places.push_back(std::move(place));
  }
  return out;
}

}  // namespace anchord::ml
