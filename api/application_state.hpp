#pragma once

#include <condition_variable>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "api/admin/access.hpp"
#include "api/admin/alarm_board.hpp"
#include "api/admin/cir_retention.hpp"
#include "api/admin/clock_watch.hpp"
#include "api/admin/event_log.hpp"
#include "api/admin/flight_events.hpp"
#include "api/admin/housekeeping.hpp"
#include "api/admin/job_service.hpp"
#include "api/admin/routes.hpp"
#include "api/admin/running_time.hpp"
#include "api/anchors/anchor_answers.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/anchors/geo_service.hpp"
#include "api/anchors/routes.hpp"
#include "api/application.hpp"
#include "api/bundles/routes.hpp"
#include "api/calibration/calibration_service.hpp"
#include "api/calibration/kit_profiles.hpp"
#include "api/calibration/routes.hpp"
#include "api/devices/device_stream.hpp"
#include "api/devices/routes.hpp"
#include "api/exchange/routes.hpp"
#include "api/flight/flight_service.hpp"
#include "api/flight/routes.hpp"
#include "api/kit/late_writer.hpp"
#include "api/learning/routes.hpp"
#include "api/measurements/demonstration.hpp"
#include "api/measurements/device_ingest.hpp"
#include "api/measurements/ingest.hpp"
#include "api/measurements/routes.hpp"
#include "api/missions/mission_service.hpp"
#include "api/missions/routes.hpp"
#include "api/mqtt/mqtt_publisher.hpp"
#include "api/omlox/omlox_locations.hpp"
#include "api/omlox/omlox_push.hpp"
#include "api/omlox/routes.hpp"
#include "api/places/routes.hpp"
#include "api/planning/routes.hpp"
#include "api/planning/site_structures.hpp"
#include "api/scope/route_sites.hpp"
#include "api/scope/scoped_stores.hpp"
#include "api/stream/hub.hpp"
#include "api/webhooks/routes.hpp"
#include "api/webhooks/webhook_service.hpp"
#include "api/work/work_desk.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"

namespace anchord::api {

/// Every service, in the order in which they are made, and what the routes of each feature work with. Each
/// names what it needs of the others; nothing below finds another by itself.
struct Application::State {
  explicit State(Deps d);
  void add_routes();
  /// Answers for who is bound to sites.
  Response run_bound(const Route& route, const Request& request);
  void check_named(SiteRule rule, const Request& request);
  std::unique_ptr<WorkDesk> make_desk();

  ServerCounts counts() const;
  nlohmann::ordered_json device_clock() const;
  nlohmann::ordered_json drone() const;
  nlohmann::ordered_json mqtt() const;
  std::string device_rows();

  /// The thread of the rounds below, until it is told to stop.
  void beat();
  void second();
  void background_round();
  void calibrate_landed();
  void publish_system(UtcTime now, ServerPulse& pulse);
  void publish_alarms(UtcTime now, std::vector<AlarmCondition> holding,
                      std::vector<std::pair<std::string_view, std::string>>& of_flight);

  Deps deps;
  const Stores& stores;
  ScopedStores scoped;
  const Stores& seen;  ///< what requests read and write, and jobs: rows of the sites of who asks
  const SteadyClock& steady;
  LateWriter late;
  PromptAccessStore prompt;
  FlightEvents flight_events;
  RunningTime running;
  Router router;
  Hub hub;
  EventLog events;
  AlarmBoard alarms;
  ModelSigner signer;
  ModelRegistry models;
  MissionService missions;
  SiteStructures structures;
  FlightService flights;
  DeviceStream stream;
  CirRetention cir_retention;
  Housekeeping housekeeping;
  ClockWatch clock_watch;
  IngestService ingest;
  DeviceIngest device_ingest;
  Demonstration demonstration;
  JobService jobs;
  std::unique_ptr<WorkDesk> desk;  ///< null: every job is this process's
  GeoService geo;
  ContradictionWatch contradictions;
  KitProfiles profiles;
  CalibrationService calibrations;
  TrainingService training;
  OmloxLocations omlox_locations;
  OmloxPush omlox_push;  ///< reads through anchor_api, once everything is there
  WebhookService webhooks;
  Audit audit;
  AdminApi admin_api;
  OrganizationApi organization_api;
  DeviceApi device_api;
  MissionApi mission_api;
  MeasurementApi measurement_api;
  AnchorAnswers anchor_answers;
  AnchorApi anchor_api;
  CalibrationApi calibration_api;
  PlanningApi planning_api;
  FlightApi flight_api;
  MqttPublisher publisher;
  ExchangeApi exchange_api;
  WebhookApi webhook_api;
  OmloxApi omlox_api;
  PlaceApi place_api;
  BundleApi bundle_api;
  LearningStores learning_stores;
  LearningApi learning_api;
  Locked<bool> stopping{false};
  std::condition_variable stop_told;
  bool started{false};
  Thread heart;
};

}  // namespace anchord::api
