#include "api/learning/measurement_query.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/support.hpp"
#include "api/learning/learning_json.hpp"

namespace anchord::api {
namespace {

constexpr double k_low_unclear = 0.4, k_high_unclear = 0.6;

}  // namespace

MeasurementLimits query_limits(const Request& request) {
  MeasurementLimits limits;
  limits.min_distance_m = query_number(request, "min_distance_m", 0, 10'000);
  limits.max_distance_m = query_number(request, "max_distance_m", 0, 10'000);
  limits.min_level_dbm = query_number(request, "min_level_dbm", -200, 50);
  limits.max_level_dbm = query_number(request, "max_level_dbm", -200, 50);
  limits.label = query_word(request, "label", k_label_words);
  return limits;
}

std::size_t query_every(const Request& request) {
  const auto every = query_number(request, "every", 1, 1'000'000);
  return every ? static_cast<std::size_t>(*every) : 1;
}

std::optional<PredictedClass> query_class(const Request& request) {
  return query_word(request, "class", k_predicted_words);
}

PredictedClass class_of(const ModelAnswer& judgement) {
  const auto p_los = judgement.verdict.p_los;
  if (!p_los || (*p_los >= k_low_unclear && *p_los <= k_high_unclear)) return PredictedClass::unclear;
  return *p_los > k_high_unclear ? PredictedClass::los : PredictedClass::nlos;
}

nlohmann::ordered_json predicted_json(const ModelAnswer& judgement) {
  const auto maybe = [](const std::optional<double>& v) {
    return v ? nlohmann::ordered_json(*v) : nlohmann::ordered_json(nullptr);
  };
  return {{"class", k_predicted_words.word(class_of(judgement))},
          {"p_los", maybe(judgement.verdict.p_los)},
          {"bias_m", maybe(judgement.verdict.bias_m)},
          {"models", range_models_json(judgement.models)}};
}

}  // namespace anchord::api
