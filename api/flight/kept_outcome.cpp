#include "api/flight/kept_outcome.hpp"

#include <nlohmann/json.hpp>

#include "api/flight/procedure_json.hpp"
#include "api/kit/or_null.hpp"
#include "api/planning/plan_json.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

std::optional<double> number(const Json& j, const char* key) {
  const auto it = j.find(key);
  return it != j.end() && it->is_number() ? std::optional(it->get<double>()) : std::nullopt;
}

bool flag(const Json& j, const char* key) {
  const auto it = j.find(key);
  return it != j.end() && it->is_boolean() && it->get<bool>();
}

PlanTargets read_targets(const Json& j) {
  PlanTargets out;
  if (!j.is_object()) return out;
  out.sigma_m = number(j, "sigma_m");
  const auto anchors = j.value("anchors", Json::object());
  for (const auto& [text, sigma_m] : anchors.items()) {
    const auto id = parse_network_id(text);
    if (id && sigma_m.is_number()) out.of_anchor[id.value()] = sigma_m.get<double>();
  }
  return out;
}

std::optional<flight::FlownTime> read_time(const Json& j) {
  if (!j.is_object()) return std::nullopt;
  const auto flown_s = number(j, "flown_s");
  if (!flown_s) return std::nullopt;
  return flight::FlownTime{forecast_of(j.value("forecast", Json())), *flown_s, flag(j, "completed"),
                           flag(j, "plan_changed")};
}

}  // namespace

nlohmann::ordered_json stored_targets(const PlanTargets& targets) {
  Ordered anchors = Ordered::object();
  for (const auto& [id, sigma_m] : targets.of_anchor) anchors[to_string(id)] = sigma_m;
  return {{"sigma_m", or_null(targets.sigma_m)}, {"anchors", std::move(anchors)}};
}

KeptOutcome kept_outcome(PlanStore& plans, const MissionId& mission) {
  KeptOutcome out;
  const auto text = plans.procedure(mission);
  if (!text || text.value().empty()) return out;
  const auto j = Json::parse(text.value(), nullptr, false);
  if (!j.is_object()) return out;
  out.priors = priors_in_document(j);
  out.targets = read_targets(j.value("targets", Json()));
  out.time = read_time(j.value("time", Json()));
  return out;
}

nlohmann::ordered_json stored_outcome(const KeptOutcome& outcome) {
  Ordered out{{"landed", true},
              {"priors", stored_priors(outcome.priors)},
              {"targets", stored_targets(outcome.targets)}};
  if (const auto& time = outcome.time)
    out["time"] = {{"forecast", forecast_json(time->forecast)},
                   {"flown_s", time->flown_s},
                   {"completed", time->completed},
                   {"plan_changed", time->plan_changed}};
  return out;
}

nlohmann::ordered_json forecast_json(const std::optional<planning::FlightTime>& forecast) {
  if (!forecast) return nullptr;
  return {{"low", forecast->low_s}, {"expected", forecast->expected_s}, {"high", forecast->high_s}};
}

std::optional<planning::FlightTime> forecast_of(const nlohmann::json& j) {
  if (!j.is_object()) return std::nullopt;
  const auto low = number(j, "low"), expected = number(j, "expected"), high = number(j, "high");
  if (!low || !expected || !high) return std::nullopt;
  return planning::FlightTime{*low, *expected, *high};
}

nlohmann::ordered_json flown_time_json(const std::optional<flight::FlownTime>& time) {
  if (!time) return nullptr;
  const auto against = time->against();
  return {{"forecast_s", forecast_json(time->forecast)},
          {"flown_s", time->flown_s},
          {"completed", time->completed},
          {"plan_changed", time->plan_changed},
          {"against_forecast",
           against ? Ordered(flight::k_against_forecast_words.word(*against)) : Ordered(nullptr)}};
}

}  // namespace anchord::api
