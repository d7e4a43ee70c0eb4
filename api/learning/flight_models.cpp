#include "api/learning/flight_models.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/learning/range_features.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

/// The radios' failure values are below it, and no correction may make a range one of them.
constexpr double k_least_range_m = 0.05;

/// Stated noise is a Gaussian of its own: no tail beside it.
void state(const StatedNoise& noise, RangeErrorModel& error_model) {
  if (noise.los_m) error_model.los_sigma_m = *noise.los_m;
  if (!noise.nlos_m) return;
  error_model.nlos_sigma_m = *noise.nlos_m;
  error_model.nlos_tail_m = 0;
}

}  // namespace

FlightModelsWish read_flight_models(const Json& models, std::vector<FieldError>& errors) {
  FlightModelsWish out;
  Fields fields(models, "/models", errors);
  for (const auto word : ml::k_task_words.words()) {
    const std::string task(word);
    const auto text = fields.text(task, 36);
    if (!text) continue;
    if (*text != "active" && *text != "none" && !parse_uuid(*text))
      fields.error(task, "bad_id", "must be active, none or the id of a model");
    else
      out.tasks[task] = *text;
  }
  out.correction = fields.word("correction", ml::k_correction_words);
  out.likelihood = fields.word("likelihood", k_likelihood_words);
  out.ask_worth = fields.word("worth", k_worth_words).value_or(out.ask_worth);
  fields.finish();
  return out;
}

Result<ModelRegistry::Active> models_for(const FlightModelsWish& wish, const ModelRegistry& registry) {
  const auto active = registry.active();
  std::map<std::string, ModelId> chosen = active->models;
  for (const auto& [task, text] : wish.tasks) {
    if (text == "active") continue;
    chosen.erase(task);
    if (text != "none") {
      BOOST_OUTCOME_TRY(const auto uuid, parse_uuid(text));
      // Models are of the whole server: to a token that is bound to sites there is none by any id.
      if (!current_sites().all()) return make_error(Errc::not_found, "no model " + to_string(uuid));
      chosen[task] = ModelId{uuid};
    }
  }
  return load_models(registry.source(), chosen, wish.correction.value_or(active->correction), true);
}

FlightModelsReport& FlightModelsReport::operator+=(const FlightModelsReport& part) {
  const double sum_m = mean_correction_m * static_cast<double>(n_corrected) +
                       part.mean_correction_m * static_cast<double>(part.n_corrected);
  n_ranges += part.n_ranges;
  n_los += part.n_los;
  n_nlos += part.n_nlos;
  n_corrected += part.n_corrected;
  n_silent += part.n_silent;
  n_believed += part.n_believed;
  if (n_corrected > 0) mean_correction_m = sum_m / static_cast<double>(n_corrected);
  if (note.empty()) note = part.note;
  return *this;
}

FlightModelsReport correct_flight(const ModelRegistry::Active& models, FlightData& flight, bool likelihood,
                                  const StatedNoise& noise) {
  FlightModelsReport out;
  double sum = 0;
  std::size_t n_withheld = 0;
  std::string withheld;  // the first, in words
  std::vector<std::optional<RangeErrorModel>> error_models(flight.ranges.size());
  for (std::size_t i = 0; i < flight.ranges.size(); ++i) {
    Range& range = flight.ranges[i];
    if (range.kind != RangeKind::tag_anchor || !(range.distance_m > k_least_range_m)) continue;
    ++out.n_ranges;
    const auto features = features_of(range);
    const auto judged = ModelRegistry::predict(models, features);
    if (!judged.note.empty() && out.note.empty()) out.note = judged.note;
    if (judged.verdict.withheld_m && n_withheld++ == 0) withheld = judged.note;
    if (!judged.verdict.p_los && !judged.verdict.bias_m) {
      ++out.n_silent;
      continue;
    }
    if (judged.verdict.los) ++(*judged.verdict.los ? out.n_los : out.n_nlos);
    std::optional<RangeErrorModel> error_model = error_model_of(judged.verdict, models.correction);
    if (noise.nlos_m && !error_model && judged.verdict.p_los)
      error_model = RangeErrorModel{*judged.verdict.p_los};
    if (error_model && likelihood) {
      state(noise, *error_model);
      error_models[i] = error_model;
    }
    if (!judged.verdict.bias_m) continue;
    const double corrected_m = range.distance_m - *judged.verdict.bias_m;
    if (!(corrected_m > k_least_range_m)) {
      error_models[i].reset();  // it is of the corrected range
      continue;
    }
    sum += *judged.verdict.bias_m;
    if (flight.received_m.empty())
      for (const Range& as_received : flight.ranges) flight.received_m.push_back(as_received.distance_m);
    range.distance_m = corrected_m;
    ++out.n_corrected;
  }
  if (out.n_corrected > 0) out.mean_correction_m = sum / static_cast<double>(out.n_corrected);
  if (n_withheld > 0)
    flight.notes.push_back("the corrections of " + std::to_string(n_withheld) + " of " +
                           std::to_string(out.n_ranges) +
                           " ranges are not applied, for example: " + withheld);
  out.n_believed = static_cast<std::size_t>(
      std::ranges::count_if(error_models, [](const auto& error_model) { return error_model.has_value(); }));
  if (out.n_believed > 0) flight.error_models = std::move(error_models);
  return out;
}

bool leave_out_worthless(std::vector<FlightModelsReport>& reports, std::vector<FlightData>& corrected,
                         const std::vector<FlightData>& raw,
                         const std::vector<std::optional<FlightSolution>>& with,
                         const std::vector<std::optional<FlightSolution>>& without) {
  bool some = false;
  for (std::size_t i = 0; i < reports.size(); ++i) {
    FlightModelsReport& report = reports[i];
    if (!report.spoke() || !with[i] || !without[i]) continue;
    report.worth = correction_worth(*without[i], *with[i], corrected[i]);
    if (report.worth->shown) continue;
    report.used = false;
    some = true;
    corrected[i] = raw[i];
    corrected[i].notes.push_back(
        "the models do not explain this flight better than its uncorrected ranges: " + report.worth->text() +
        "; solved without them");
  }
  return some;
}

Ordered flight_models_report_json(const FlightModelsReport& f) {
  Ordered worth = nullptr;
  if (f.worth)
    worth = {{"gain_per_range", f.worth->gain},
             {"sigma", f.worth->sigma},
             {"n_ranges", f.worth->n_ranges},
             {"n_blocks", f.worth->n_blocks},
             {"shown", f.worth->shown}};
  return {{"n_ranges", f.n_ranges},
          {"n_los", f.n_los},
          {"n_nlos", f.n_nlos},
          {"n_corrected", f.n_corrected},
          {"n_silent", f.n_silent},
          {"n_believed", f.n_believed},
          {"mean_correction_m", f.mean_correction_m},
          {"note", f.note.empty() ? Ordered(nullptr) : Ordered(f.note)},
          {"used", f.used},
          {"worth", std::move(worth)}};
}

Ordered flight_models_json(const ModelRegistry::Active& models,
                           const std::vector<FlightModelsReport>& flights) {
  Ordered out = Ordered::object();
  for (const auto word : ml::k_task_words.words()) {
    const std::string task(word);
    const auto at = models.models.find(task);
    out[task] = at == models.models.end() ? Ordered(nullptr) : Ordered(to_string(at->second));
  }
  out["correction"] = ml::k_correction_words.word(models.correction);
  out["likelihood"] = k_likelihood_words.word(
      std::ranges::any_of(flights, [](const auto& f) { return f.used && f.n_believed > 0; }));
  Ordered list = Ordered::array();
  for (const auto& f : flights) list.push_back(flight_models_report_json(f));
  out["flights"] = std::move(list);
  return out;
}

}  // namespace anchord::api
