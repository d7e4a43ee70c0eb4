#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "core/flight/flown_time.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/ports/plan_store.hpp"
#include "core/procedure/flight_priors.hpp"

namespace anchord::api {

/// What of a mission's flight is kept with it, in the air and after: what turns and height searches told,
/// what the flown plan wants of its anchors, how long it took. Empty where none is.
struct KeptOutcome {
  procedure::FlightPriors priors;
  PlanTargets targets;
  std::optional<flight::FlownTime> time;  ///< of a flight that has ended
};
KeptOutcome kept_outcome(PlanStore& plans, const MissionId& mission);
/// Of a flight that has ended, as it is kept.
nlohmann::ordered_json stored_outcome(const KeptOutcome& outcome);

nlohmann::ordered_json stored_targets(const PlanTargets& targets);
nlohmann::ordered_json forecast_json(const std::optional<planning::FlightTime>& forecast);
std::optional<planning::FlightTime> forecast_of(const nlohmann::json& json);
/// `flight_time` of a mission.
nlohmann::ordered_json flown_time_json(const std::optional<flight::FlownTime>& time);

}  // namespace anchord::api
