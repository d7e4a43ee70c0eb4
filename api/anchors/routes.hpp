#pragma once

#include "api/kit/audit.hpp"

namespace anchord {
class AnchorStore;
class CalibrationStore;
class Clock;
class FrameStore;
class RevisionStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class ContradictionWatch;
class GeoService;
class MissionService;
class Router;

/// What the routes of anchors, sites and local frames work with; lives as long as the router.
struct AnchorApi {
  SiteStore& sites;
  AnchorStore& anchors;
  CalibrationStore& calibrations;
  RevisionStore& revisions;
  FrameStore& frames;
  MissionService& missions;
  GeoService& geo;
  ContradictionWatch& contradictions;
  const Clock& clock;
  Audit audit;
};

void add_anchor_routes(Router& router, AnchorApi& api);
void add_site_routes(Router& router, AnchorApi& api);
void add_frame_routes(Router& router, AnchorApi& api);

}  // namespace anchord::api
