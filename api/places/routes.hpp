#pragma once

#include <functional>
#include <set>
#include <string>

#include "api/kit/audit.hpp"
#include "api/work/worker_port.hpp"
#include "core/base/locked.hpp"

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
  /// Tokens whose picture is being read, each one at a time: one that keeps its decoder busy leaves the
  /// others a place. Not more than k_pictures_at_once: each may take a gigabyte of its worker's.
  Locked<std::set<std::string>> reading{};
};

void add_building_routes(Router& router, PlaceApi& api);
void add_floor_routes(Router& router, PlaceApi& api);
void add_floor_plan_routes(Router& router, PlaceApi& api);

}  // namespace anchord::api
