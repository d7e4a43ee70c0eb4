#pragma once

#include <atomic>
#include <functional>

#include "api/kit/audit.hpp"
#include "api/learning/worker_port.hpp"

namespace anchord {
class Clock;
class PlaceStore;
class SiteStore;
class SteadyClock;
}  // namespace anchord

namespace anchord::api {

class JobService;
class Router;

/// What the routes of buildings, floors and their plans work with; lives as long as the router.
struct PlaceApi {
  PlaceStore& places;
  SiteStore& sites;
  JobService& jobs;
  RunWork run_work;  ///< decodes and traces pictures of strangers: in a process of its own
  const Clock& clock;
  const SteadyClock& steady;
  Audit audit;
  /// A building, a floor or what is accepted of it was written: what is planned by it is read anew.
  std::function<void()> changed;
  /// One picture is read at a time: each may take a gigabyte of the worker's.
  std::atomic<bool> reading{false};
};

void add_building_routes(Router& router, PlaceApi& api);
void add_floor_routes(Router& router, PlaceApi& api);
void add_floor_plan_routes(Router& router, PlaceApi& api);

}  // namespace anchord::api
