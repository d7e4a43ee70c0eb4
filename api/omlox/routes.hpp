#pragma once

namespace anchord {
class Clock;
class PlaceStore;
}  // namespace anchord

namespace anchord::api {

struct AnchorApi;
class OmloxLocations;
class Router;

/// What the omlox routes work with; lives as long as the router.
struct OmloxApi {
  AnchorApi& anchors;
  PlaceStore& places;
  OmloxLocations& locations;
  const Clock& clock;
};

/// A part of the omlox hub API 2.0.0 at /omlox/v2, read-only, with errors in its own form.
void add_omlox_routes(Router& router, OmloxApi& api);

}  // namespace anchord::api
