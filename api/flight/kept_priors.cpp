#include "api/flight/kept_priors.hpp"

#include <nlohmann/json.hpp>

#include "api/flight/procedure_json.hpp"

namespace anchord::api {

procedure::FlightPriors kept_priors(PlanStore& plans, const MissionId& mission) {
  const auto kept = plans.procedures();
  if (!kept) return {};
  for (const auto& [id, text] : kept.value()) {
    const auto j = nlohmann::json::parse(text, nullptr, false);
    if (id == mission && j.is_object()) return priors_of(j.value("clues", nlohmann::json()));
  }
  return {};
}

}  // namespace anchord::api
