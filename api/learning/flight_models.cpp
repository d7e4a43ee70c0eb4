#include "api/learning/flight_models.hpp"

#include <array>
#include <nlohmann/json.hpp>

#include "api/json/reader.hpp"
#include "api/learning/range_features.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

constexpr std::array<const char*, 4> k_tasks{"nlos_id", "los_bias", "nlos_bias", "bias"};
/// The radios' failure values are below it, and no correction may make a range one of them.
constexpr double k_least_range_m = 0.05;

}  // namespace

FlightModelsWish read_flight_models(const Json& models, std::vector<FieldError>& errors) {
  FlightModelsWish out;
  Fields fields(models, "/models", errors);
  for (const char* task : k_tasks) {
    const auto text = fields.text(task, 36);
    if (!text) continue;
    if (*text != "active" && *text != "none" && !parse_uuid(*text))
      fields.error(task, "bad_id", "must be active, none or the id of a model");
    else
      out.tasks[task] = *text;
  }
  if (const auto word = fields.word("correction", {"weighted", "hard", "none"}))
    out.correction = static_cast<ml::Correction>(*word);
  fields.finish();
  return out;
}

Result<ModelRegistry::Active> models_for(const FlightModelsWish& wish, const ModelRegistry& registry,
                                         ModelStore& store) {
  const auto active = registry.active();
  std::map<std::string, ModelId> chosen = active->models;
  for (const auto& [task, text] : wish.tasks) {
    if (text == "active") continue;
    chosen.erase(task);
    if (text != "none") {
      BOOST_OUTCOME_TRY(const auto uuid, parse_uuid(text));
      chosen[task] = ModelId{uuid};
    }
  }
  return load_models(store, chosen, wish.correction.value_or(active->correction));
}

FlightModelsReport correct_flight(const ModelRegistry::Active& models, FlightData& flight) {
  FlightModelsReport out;
  double sum = 0;
  for (auto& range : flight.ranges) {
    if (range.kind != RangeKind::tag_anchor || !(range.distance_m > k_least_range_m)) continue;
    ++out.n_ranges;
    const auto features = features_of(range);
    const auto judged = ModelRegistry::judge(models, features);
    if (!judged.note.empty()) {
      ++out.n_silent;
      if (out.note.empty()) out.note = judged.note;
      continue;
    }
    if (judged.verdict.los) ++(*judged.verdict.los ? out.n_los : out.n_nlos);
    if (!judged.verdict.bias_m) continue;
    const double corrected_m = range.distance_m - *judged.verdict.bias_m;
    if (!(corrected_m > k_least_range_m)) continue;
    sum += *judged.verdict.bias_m;
    range.distance_m = corrected_m;
    ++out.n_corrected;
  }
  if (out.n_corrected > 0) out.mean_correction_m = sum / static_cast<double>(out.n_corrected);
  return out;
}

Ordered flight_models_json(const ModelRegistry::Active& models,
                           const std::vector<FlightModelsReport>& flights) {
  Ordered out = Ordered::object();
  for (const char* task : k_tasks) {
    const auto at = models.models.find(task);
    out[task] = at == models.models.end() ? Ordered(nullptr) : Ordered(to_string(at->second));
  }
  out["correction"] = correction_word(models.correction);
  Ordered list = Ordered::array();
  for (const auto& f : flights)
    list.push_back({{"n_ranges", f.n_ranges},
                    {"n_los", f.n_los},
                    {"n_nlos", f.n_nlos},
                    {"n_corrected", f.n_corrected},
                    {"n_silent", f.n_silent},
                    {"mean_correction_m", f.mean_correction_m},
                    {"note", f.note.empty() ? Ordered(nullptr) : Ordered(f.note)}});
  out["flights"] = std::move(list);
  return out;
}

}  // namespace anchord::api
