#pragma once

namespace anchord::api {

class AccessService;
class Router;

/// /api/v1/tokens, /session, /me, /ws-tickets. The service must outlive the router.
void add_access_routes(Router& router, AccessService& access);

}  // namespace anchord::api
