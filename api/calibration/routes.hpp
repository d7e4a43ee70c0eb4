#pragma once

#include <string>

#include "api/anchors/anchor_goals.hpp"
#include "api/calibration/datum_gate.hpp"
#include "api/calibration/outdated_gate.hpp"
#include "api/kit/audit.hpp"

namespace anchord {
class AnchorStore;
class CalibrationStore;
class Clock;
class ExclusionStore;
class MissionStore;
class RevisionStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class CalibrationService;
class ContradictionWatch;
class EventLog;
class Hub;
class JobService;
class KitProfiles;
class MissionService;
class Router;

/// What the routes of calibrations, revisions and kits work with; lives as long as the router.
struct CalibrationApi {
  CalibrationService& calibrations;
  CalibrationStore& calibration_store;
  RevisionStore& revisions;
  SiteStore& sites;
  AnchorStore& anchors;
  MissionStore& mission_store;
  ExclusionStore& exclusions;
  MissionService& missions;
  ContradictionWatch& contradictions;
  KitProfiles& profiles;
  JobService& jobs;
  Hub& hub;
  EventLog& events;
  const Clock& clock;
  Audit audit;
  std::string program;  ///< "anchord 0.2.0", for reports
  AnchorGoals goals{};
  DatumChanges datum_changes = std::make_shared<DatumChanges::element_type>();
};

void add_calibration_routes(Router& router, CalibrationApi& api);
void add_comparison_routes(Router& router, CalibrationApi& api);
void add_datum_routes(Router& router, CalibrationApi& api);
void add_kit_routes(Router& router, CalibrationApi& api);

}  // namespace anchord::api
