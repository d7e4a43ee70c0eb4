#pragma once

#include "api/kit/audit.hpp"

namespace anchord {
class AnchorStore;
class Clock;
class FrameStore;
}  // namespace anchord

namespace anchord::api {

class ContradictionWatch;
class GeoService;
class MissionService;
class Router;

/// What the routes of anchors, sites and local frames work with; lives as long as the router.
struct AnchorApi {
  AnchorStore& anchors;
  FrameStore* frames{nullptr};  ///< null: their routes do not exist
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
