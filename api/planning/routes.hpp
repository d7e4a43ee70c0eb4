#pragma once

#include <functional>
#include <optional>

#include "api/kit/audit.hpp"
#include "core/base/ids.hpp"
#include "core/types/plan.hpp"

namespace anchord {
class Clock;
class PlanStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class Router;
class SiteStructures;

/// What the routes of plans work with; lives as long as the router.
struct PlanningApi {
  PlanStore& plans;
  SiteStore& sites;
  const Clock& clock;
  Audit audit;
  /// Which mission flies this plan.
  std::function<std::optional<MissionId>(const PlanId&)> flown_with;
  /// A new revision was stored: a flight that flies the plan shows it.
  std::function<void(const Plan&)> saved;
  SiteStructures& structures;
};

void add_plan_routes(Router& router, PlanningApi& api);

}  // namespace anchord::api
