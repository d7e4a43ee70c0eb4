#pragma once

#include "api/kit/audit.hpp"

namespace anchord {
class Clock;
class ExclusionStore;
class MeasurementStore;
}  // namespace anchord

namespace anchord::api {

class Demonstration;
class EventLog;
class IngestService;
class MissionService;
class ModelRegistry;
class Router;

/// What the routes of measurements work with; lives as long as the router.
struct MeasurementApi {
  MeasurementStore& measurements;
  IngestService& ingest;
  MissionService& missions;
  ModelRegistry& models;
  ExclusionStore& exclusions;
  EventLog& events;
  const Clock& clock;
  Audit audit;
  Demonstration& demonstration;
};

void add_measurement_routes(Router& router, MeasurementApi& api);
void add_exclusion_routes(Router& router, MeasurementApi& api);

}  // namespace anchord::api
