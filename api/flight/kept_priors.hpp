#pragma once

#include "core/ports/plan_store.hpp"
#include "core/procedure/flight_priors.hpp"

namespace anchord::api {

/// What turns and height searches of a mission's flight told, as kept with it; empty where none is.
procedure::FlightPriors kept_priors(PlanStore& plans, const MissionId& mission);

}  // namespace anchord::api
