#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "api/kit/audit.hpp"
#include "api/kit/problem.hpp"
#include "api/kit/router.hpp"
#include "core/types/mission.hpp"

namespace anchord {
class Clock;
class MeasurementStore;
class MissionBin;
class MissionStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class DeviceStream;
class EventLog;
class FlightEvents;
class Fields;
class Housekeeping;
class MissionControl;
class MissionService;
class RunningTime;

/// The actions of a mission that move an aircraft.
struct FlightActions {
  std::vector<std::string_view> words{};  ///< empty: nothing is flown here
  std::function<Response(const Request& request, const std::string& action, Fields& fields,
                         std::vector<FieldError>& errors)>
      act{};
};

/// What the routes of missions work with; lives as long as the router.
struct MissionApi {
  MissionService& missions;
  MissionStore& mission_store;
  MeasurementStore& measurements;
  SiteStore& sites;
  MissionBin& bin;
  DeviceStream& stream;
  EventLog& events;
  FlightEvents& flight_events;
  Housekeeping& housekeeping;
  RunningTime& running;
  std::int64_t keep_deleted_ns{0};
  const Clock& clock;
  Audit audit;
  MissionControl& control;
  FlightActions flight{};
  /// How long a mission's flight took beside its forecast, null where none has ended; given by api/flight.
  std::function<nlohmann::ordered_json(const MissionId&)> flight_time{};
};

/// A mission by the path: 404 where none ever was, 410 for one in the bin, with the way back.
Mission named_mission(MissionApi& api, const Request& request);
/// With its ETag, which covers all that the body says.
Response mission_answer(MissionApi& api, int status, const Mission& mission);
std::string etag_of(const Response& mission_answer);
/// 409 no-control unless the request names the lease of this mission's control.
void require_control(MissionApi& api, const Request& request, const MissionId& mission,
                     const std::string& lease, const std::string& what);

void add_mission_routes(Router& router, MissionApi& api);
void add_mission_bin_routes(Router& router, MissionApi& api);
void add_mission_correct_routes(Router& router, MissionApi& api);

}  // namespace anchord::api
