#pragma once

#include "api/kit/audit.hpp"
#include "api/missions/routes.hpp"

namespace anchord::api {

class EventLog;
class FlightService;

/// What the routes of the flight work with; lives as long as the router.
struct FlightApi {
  FlightService& flights;
  MissionApi& missions;
  ProcedureLog& procedure_log;
  EventLog& events;
  Audit audit;
};

void add_flight_routes(Router& router, FlightApi& api);
void add_plan_change_routes(Router& router, FlightApi& api);
/// For POST /missions/{id}/actions. `api` must outlive the router.
/// Of who is bound to sites: an aircraft that is commanded for another site is neither named nor taken, 409.
/// Control that nobody uses keeps nobody from `taking` it.
void refuse_elsewhere(FlightApi& api, bool taking = false);

FlightActions flight_actions(FlightApi& api);

}  // namespace anchord::api
