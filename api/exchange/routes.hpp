#pragma once

namespace anchord {
class MeasurementStore;
class MissionStore;
}  // namespace anchord

namespace anchord::api {

struct AnchorApi;
class Router;

/// What the routes for other people's programs work with; lives as long as the router.
struct ExchangeApi {
  AnchorApi& anchors;
  MissionStore& missions;
  MeasurementStore& measurements;
};

/// OGC API Features at /ogc, read-only.
void add_ogc_routes(Router& router, ExchangeApi& api);

}  // namespace anchord::api
