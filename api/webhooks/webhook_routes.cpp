#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/webhooks/cloud_event.hpp"
#include "api/webhooks/routes.hpp"
#include "api/webhooks/webhook_service.hpp"
#include "core/ports/web_post.hpp"
#include "core/ports/webhook_store.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_most_webhooks = 20;
constexpr std::size_t k_most_token = 4096;  ///< of a hub, often a JWT

std::string etag(const Webhook& webhook) { return "\"h-" + std::to_string(webhook.version) + '"'; }

Ordered live_json(const std::optional<HubLive>& live) {
  if (!live) return nullptr;
  return {{"taken", live->taken},
          {"tried_at", to_rfc3339(live->tried)},
          {"status", or_null(live->status)},
          {"fault", text_or_null(live->fault)}};
}

/// Never with its secret, which is shown once, nor with the token of a hub.
Ordered webhook_json(const WebhookApi& s, const Webhook& w) {
  const bool hub = w.kind == WebhookKind::omlox_hub;
  Ordered out{{"id", to_string(w.id)}, {"name", w.name},       {"url", w.url},
              {"events", w.events},    {"enabled", w.enabled}, {"created_at", to_rfc3339(w.created)}};
  out["kind"] = k_webhook_kind_words.word(w.kind);
  out["dialect"] = hub ? Ordered(k_dialect_words.word(w.dialect)) : Ordered(nullptr);
  out["token_set"] = !w.token.empty();
  out["live"] = hub ? live_json(s.service.live(w.id)) : Ordered(nullptr);
  return out;
}

Ordered delivery_json(const WebhookDelivery& d) {
  return {{"id", to_string(d.id)},
          {"event", d.event},
          {"state", k_delivery_words.word(d.state)},
          {"created_at", to_rfc3339(d.created)},
          {"attempts", d.attempts},
          {"tried_at", d.tried ? Ordered(to_rfc3339(*d.tried)) : Ordered(nullptr)},
          {"status", or_null(d.status)},
          {"fault", text_or_null(d.fault)}};
}

std::vector<std::string> all_events(WebhookKind kind) {
  std::vector<std::string> out;
  for (const auto one : k_webhook_events) {
    if (may_ask_for(kind, one)) out.emplace_back(one);
  }
  return out;
}

void read_events(Fields& fields, Webhook& webhook, std::vector<FieldError>& errors) {
  const Json* list = fields.child("events");
  if (list == nullptr) return;
  const auto may = all_events(webhook.kind);
  webhook.events.clear();
  const auto known = [&may](const Json& one) {
    return one.is_string() && std::ranges::find(may, one.get_ref<const std::string&>()) != may.end();
  };
  if (!list->is_array() || list->empty() || !std::all_of(list->begin(), list->end(), known)) {
    std::string all;
    for (const auto& one : may) all += (all.empty() ? "" : ", ") + one;
    errors.push_back({"/events", "unknown_value", "must be a list of " + all});
    return;
  }
  for (const auto& one : *list) {
    auto code = one.get<std::string>();
    if (std::ranges::find(webhook.events, code) == webhook.events.end())
      webhook.events.push_back(std::move(code));
  }
}

/// What only hubs have.
void read_hub(Fields& fields, Webhook& webhook, std::vector<FieldError>& errors) {
  const auto dialect = fields.word("dialect", k_dialect_words);
  const auto token = fields.text("token", k_most_token);
  if (webhook.kind != WebhookKind::omlox_hub) {
    for (const char* key : {"dialect", "token"}) {
      if (fields.has(key))
        errors.push_back({fields.pointer(key), "not_applicable", "allowed only with kind omlox_hub"});
    }
    return;
  }
  if (dialect) webhook.dialect = *dialect;
  if (!token) return;
  webhook.token = *token;
  // It becomes a header.
  if (!std::ranges::all_of(*token, [](char c) { return c > ' ' && c < 0x7f; }))
    errors.push_back({"/token", "bad_value", "must be printable ASCII without blanks"});
}

/// Fields of a body over what there is; `made`: name and url must be there.
void read(WebhookApi& s, const Json& body, Webhook& webhook, bool made) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  if (made) {
    webhook.kind = fields.word("kind", k_webhook_kind_words).value_or(WebhookKind::cloud_event);
    webhook.events = all_events(webhook.kind);
  }
  if (const auto name = fields.text("name", 100, made)) webhook.name = *name;
  if (const auto url = fields.text("url", 500, made)) {
    webhook.url = *url;
    if (s.post != nullptr) {
      if (const auto fit = s.post->check(*url); !fit)
        errors.push_back({"/url", "bad_value", fit.error().message});
    }
    if (webhook.kind == WebhookKind::omlox_hub && url->find('?') != std::string::npos)
      errors.push_back({"/url", "bad_value", "must be the root of the hub's API, like https://host/v2"});
  }
  if (const auto enabled = fields.boolean("enabled")) webhook.enabled = *enabled;
  read_events(fields, webhook, errors);
  read_hub(fields, webhook, errors);
  fields.finish();
  refuse_if_any(errors);
}

Response answer(WebhookApi& s, int status, const Webhook& webhook) {
  Response response = json_response(status, webhook_json(s, webhook));
  response.header("ETag", etag(webhook));
  return response;
}

Webhook path_webhook(WebhookApi& s, const Request& request) {
  return value_or_problem(s.store.webhook(path_id<WebhookId>(request)));
}

/// For the audit log: user info and query are where keys of receivers stand, and what is there is never
/// deleted.
std::string without_keys(const std::string& url) {
  const auto scheme = url.find("://");
  const auto host = scheme == std::string::npos ? 0 : scheme + 3;
  std::string shown = url.substr(0, url.find_first_of("?#", host));
  const auto path = std::min(shown.find('/', host), shown.size());
  if (const auto user = shown.rfind('@', path); user != std::string::npos && user >= host && user < path)
    shown.erase(host, user + 1 - host);
  return shown;
}

Response create(WebhookApi& s, const Request& request) {
  check_query(request, {});
  if (s.post == nullptr) throw_problem(422, "unsupported", "this server sends no webhooks");
  Webhook webhook;
  webhook.id.uuid = make_uuid_v7(s.clock.now());
  webhook.created = s.clock.now();
  read(s, json_body(request), webhook, true);
  if (value_or_problem(s.store.webhooks()).size() >= k_most_webhooks)
    throw_problem(409, "conflict",
                  "there are " + std::to_string(k_most_webhooks) + " webhooks: delete one first");
  if (webhook.kind == WebhookKind::cloud_event) webhook.secret = make_webhook_secret();
  value_or_problem(s.store.insert(webhook));
  s.service.changed();
  s.audit(request, "webhook.create " + to_string(webhook.id) + ' ' + without_keys(webhook.url));
  Ordered body = webhook_json(s, webhook);
  body["secret"] = text_or_null(webhook.secret);
  Response response = json_response(201, body);
  response.header("ETag", etag(webhook)).header("Location", "/api/v1/webhooks/" + to_string(webhook.id));
  return response;
}

Response patch(WebhookApi& s, const Request& request) {
  check_query(request, {});
  Webhook webhook = path_webhook(s, request);
  require_match(request, etag(webhook));
  read(s, json_body(request), webhook, false);
  value_or_problem(s.store.update(webhook, webhook.version));
  s.service.changed();
  s.audit(request, "webhook.change " + to_string(webhook.id) + ' ' + without_keys(webhook.url));
  return answer(s, 200, path_webhook(s, request));
}

Response remove(WebhookApi& s, const Request& request) {
  check_query(request, {});
  const Webhook webhook = path_webhook(s, request);
  require_match(request, etag(webhook));
  value_or_problem(s.store.remove(webhook.id));
  s.service.changed();
  s.audit(request, "webhook.delete " + to_string(webhook.id) + ' ' + without_keys(webhook.url));
  Response response;
  response.status = 204;
  return response;
}

Response test(WebhookApi& s, const Request& request) {
  check_query(request, {});
  const Webhook webhook = path_webhook(s, request);
  if (!webhook.enabled) throw_problem(422, "state", "the webhook is switched off: set enabled to true");
  return json_response(202, delivery_json(value_or_problem(s.service.test(webhook))));
}

Response deliveries(WebhookApi& s, const Request& request) {
  check_query(request, {"limit", "cursor"});
  const Webhook webhook = path_webhook(s, request);
  const auto page = page_query(request);
  auto rows =
      value_or_problem(s.store.deliveries(webhook.id, page.limit + 1, cursor_id<DeliveryId>(page.cursor)));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& row : rows) items.push_back(delivery_json(row));
  return list_response(request, std::move(items), more ? to_string(rows.back().id) : "");
}

}  // namespace

void add_webhook_routes(Router& router, WebhookApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  // Addresses of webhooks often are secrets themselves: only who may set them up sees them.
  const auto access = Access::any_of({Role::integrator});
  const std::string one = "/api/v1/webhooks/{id}";
  router.add({Method::get, "/api/v1/webhooks", access, [&s](const Request& request) {
                check_query(request, {});
                Ordered items = Ordered::array();
                for (const auto& webhook : value_or_problem(s.store.webhooks()))
                  items.push_back(webhook_json(s, webhook));
                return list_response(request, std::move(items), "");
              }});
  router.add(keeps_nothing({Method::post, "/api/v1/webhooks", access, on(create)}));
  router.add({Method::get, one, access, [&s](const Request& request) {
                check_query(request, {});
                return answer(s, 200, path_webhook(s, request));
              }});
  router.add({Method::patch, one, access, on(patch), 1 << 20, false, true});
  router.add({Method::del, one, access, on(remove), 1 << 20, false, true});
  router.add({Method::post, one + "/test", access, on(test)});
  router.add({Method::get, one + "/deliveries", access, on(deliveries)});
}

}  // namespace anchord::api
