#pragma once

#include "api/kit/audit.hpp"

namespace anchord {
class Clock;
class WebhookStore;
class WebPost;
}  // namespace anchord

namespace anchord::api {

class Router;
class WebhookService;

/// What the routes of webhooks work with; lives as long as the router.
struct WebhookApi {
  WebhookStore& store;
  WebhookService& service;
  const WebPost* post;  ///< null: this server sends nothing
  const Clock& clock;
  Audit audit;
};

void add_webhook_routes(Router& router, WebhookApi& api);

}  // namespace anchord::api
