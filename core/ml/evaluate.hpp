#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/ml/dataset.hpp"
#include "core/ml/metrics.hpp"
#include "core/ml/model.hpp"

namespace anchord::ml {

/// A correction beside no correction, on the same rows.
struct BiasEvaluation {
  ErrorStats raw{}, corrected{};
};

struct PlaceEvaluation {
  std::string place{};
  std::size_t rows{};
  std::optional<double> accuracy{};
  std::optional<BiasEvaluation> bias{};
};

/// How a model does on rows it has not seen.
struct Evaluation {
  std::size_t rows{};
  std::optional<Confusion> confusion{};  ///< with the model's threshold
  double brier{}, log_loss{}, roc_auc{};
  std::optional<BiasEvaluation> all{}, los{}, nlos{};
  std::optional<double> nll{};       ///< mean negative log-likelihood of the bias
  std::optional<double> within95{};  ///< share of the biases within 1.96 of the sigmas claimed for them
  std::vector<RocPoint> roc{};
  std::vector<CdfPoint> cdf_raw{}, cdf_corrected{};
  std::vector<PlaceEvaluation> places{};
};

/// data  has the model's features, in the model's order. A model of one class's bias is measured on the rows
/// of that class where labels exist.
Evaluation evaluate(const Model& model, const Dataset& data);

}  // namespace anchord::ml
