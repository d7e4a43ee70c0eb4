#pragma once

#include <functional>
#include <string_view>

#include "api/anchors/anchor_goals.hpp"
#include "api/kit/audit.hpp"
#include "api/kit/message.hpp"

namespace anchord {
class AnchorStore;
class CalibrationStore;
class Clock;
class FrameStore;
class OrganizationStore;
class RevisionStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class AnchorAnswers;
class ContradictionWatch;
class GeoService;
class MissionService;
class Router;

/// What the routes of anchors, sites and local frames work with; lives as long as the router.
struct AnchorApi {
  SiteStore& sites;
  OrganizationStore& organizations;
  AnchorStore& anchors;
  CalibrationStore& calibrations;
  RevisionStore& revisions;
  FrameStore& frames;
  MissionService& missions;
  GeoService& geo;
  ContradictionWatch& contradictions;
  const Clock& clock;
  Audit audit;
  /// The published anchors that a request selects as a file of another program (`format` of GET /anchors);
  /// given by api/exchange.
  std::function<Response(std::string_view format, const Request&)> file{};
  AnchorAnswers* answers{nullptr};  ///< where those of single anchors are kept; null: nowhere
  AnchorGoals goals{};
};

void add_anchor_routes(Router& router, AnchorApi& api);
void add_site_routes(Router& router, AnchorApi& api);
void add_frame_routes(Router& router, AnchorApi& api);

}  // namespace anchord::api
