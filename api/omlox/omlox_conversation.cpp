#include "api/omlox/omlox_conversation.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/omlox/omlox_locations.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

// Codes of the hub API.
constexpr int k_unknown_event = 10000, k_unknown_topic = 10001, k_subscribe_failed = 10002,
              k_unsubscribe_failed = 10003, k_not_authorized = 10004, k_invalid_data = 10005;

constexpr std::string_view k_updates = "location_updates", k_geojson = "location_updates:geojson";
/// Of hubs that have fences and the like.
constexpr std::array<std::string_view, 5> k_other_topics{
    "proximity_updates", "fence_events", "fence_events:geojson", "trackable_motions", "collision_events"};

std::string text_of(const Json& message, const char* key) {
  const auto at = message.find(key);
  return at != message.end() && at->is_string() ? at->get<std::string>() : std::string();
}

}  // namespace

OmloxConversation::OmloxConversation(Hub& hub, const OmloxLocations& locations, Listener first,
                                     TokenDoor door)
    : hub_(hub), locations_(locations), door_(std::move(door)), listener_(std::in_place, std::move(first)) {}

OmloxConversation::~OmloxConversation() = default;

bool OmloxConversation::Wanted::accepts(const OmloxLocation& location) const {
  if (provider_id && *provider_id != location.provider.id) return false;
  if (provider_type && *provider_type != location.provider.type) return false;
  if (source && *source != location.provider.id) return false;
  return !accuracy_m || (location.accuracy_m && *location.accuracy_m <= *accuracy_m);
}

void OmloxConversation::on_open(std::function<void()> wake) {
  wake_ = std::move(wake);
  membership_ = hub_.join(*this);
}

void OmloxConversation::on_close() { membership_ = {}; }

void OmloxConversation::on_text(std::string_view text) {
  Json message;
  if (text.size() > 64 * 1024) return close(1009, "a message can have at most 64 KiB");
  if (const auto wrong = parse_json(text, message))
    return refuse(k_invalid_data, "this is not JSON that can be read: " + wrong->detail);
  if (!message.is_object()) return refuse(k_invalid_data, "send JSON objects with an event");
  const auto event = text_of(message, "event");
  if (event == "subscribe") return subscribe(message);
  if (event == "unsubscribe") return unsubscribe(message);
  if (event == "message")
    return refuse(
        k_not_authorized,
        "this hub is read-only: send measurements to the anchord API (POST /api/v1/ranges, /fixes)");
  refuse(k_unknown_event, "event must be subscribe or unsubscribe");
}

/// By the token of this message, or by what the connection came in with.
bool OmloxConversation::let_in(const Json& message) {
  const auto params = message.find("params");
  const auto token = params != message.end() && params->is_object() ? text_of(*params, "token") : "";
  if (!token.empty()) {
    Listener in = door_ ? door_(token) : Listener{};
    if (in.holds) {
      {
        auto listener = listener_.lock();
        *listener = std::move(in);
      }
      // What came for the token before may be of a site that this one does not see.
      auto output = output_.lock();
      output->poses.clear();
      return true;
    }
    refuse(k_not_authorized, "the token is unknown, expired or revoked, or may not read");
    if (++wrong_tokens_ >= k_most_wrong_tokens) close(4001, "auth");
    return false;
  }
  {
    const auto listener = listener_.lock();
    if (listener->holds && listener->holds()) return true;
  }
  refuse(k_not_authorized, "send a token in params.token");
  return false;
}

std::optional<OmloxConversation::Wanted> OmloxConversation::wanted(const Json& message) {
  Wanted out;
  out.topic = text_of(message, "topic");
  if (std::ranges::find(k_other_topics, out.topic) != k_other_topics.end()) {
    refuse(k_subscribe_failed, "this hub has no " + out.topic);
    return std::nullopt;
  }
  if (out.topic != k_updates && out.topic != k_geojson) {
    refuse(k_unknown_topic, "the topics are location_updates and location_updates:geojson");
    return std::nullopt;
  }
  out.geojson = out.topic == k_geojson;
  std::vector<FieldError> errors;
  Fields fields(message, "", errors);
  fields.child("event");
  fields.child("topic");
  if (const Json* params = fields.child("params")) {
    Fields inner(*params, "/params", errors);
    inner.child("token");
    out.provider_id = inner.text("provider_id", 200);
    out.provider_type = inner.text("provider_type", 40);
    out.source = inner.text("source", 200);
    out.accuracy_m = inner.number("accuracy", 0, 1e6);
    out.geojson = inner.boolean("geojson").value_or(out.geojson);
    // Local metres are to be had at /providers/locations?crs=local.
    static constexpr std::array<std::string_view, 1> k_crs{"EPSG:4326"};
    inner.word("crs", k_crs);
    inner.finish();
  }
  fields.finish();
  if (errors.empty()) return out;
  refuse(k_invalid_data, errors.front().pointer + ": " + errors.front().detail);
  return std::nullopt;
}

void OmloxConversation::subscribe(const Json& message) {
  if (!let_in(message)) return;
  auto what = wanted(message);
  if (!what) return;
  if (subscriptions_.size() >= k_max_subscriptions)
    return refuse(k_subscribe_failed, "a connection can have at most 32 subscriptions");
  const auto id = next_id_++;
  const std::string topic = what->topic;
  const bool first = subscriptions_.empty();
  subscriptions_.emplace(id, std::move(*what));
  reply(to_wire(Ordered{{"event", "subscribed"}, {"topic", topic}, {"subscription_id", id}}));
  if (first) (void)membership_.subscribe(Topic::drone_pose, std::nullopt);
}

void OmloxConversation::unsubscribe(const Json& message) {
  const auto id = message.find("subscription_id");
  const auto at = id != message.end() && id->is_number_unsigned()
                      ? subscriptions_.find(id->get<std::uint64_t>())
                      : subscriptions_.end();
  if (at == subscriptions_.end()) return refuse(k_unsubscribe_failed, "there is no such subscription_id");
  reply(to_wire(
      Ordered{{"event", "unsubscribed"}, {"topic", at->second.topic}, {"subscription_id", at->first}}));
  std::erase_if(messages_, [&](const auto& one) { return one.first == at->first; });
  subscriptions_.erase(at);
  if (subscriptions_.empty()) membership_.unsubscribe(Topic::drone_pose);
}

void OmloxConversation::refuse(int code, std::string_view why) {
  reply(to_wire(Ordered{{"event", "error"}, {"code", code}, {"description", why}}));
}

void OmloxConversation::reply(std::string text) {
  bool room = true;
  {
    auto output = output_.lock();
    room = output->replies.size() < k_max_replies;
    if (room && !output->close) output->replies.push_back(std::move(text));
  }
  if (!room) return close(4008, "slow_consumer");
  if (wake_) wake_();
}

void OmloxConversation::close(std::uint16_t code, std::string_view reason) {
  {
    auto output = output_.lock();
    if (output->close) return;
    output->close = {code, std::string(reason)};
    output->poses.clear();
  }
  if (wake_) wake_();
}

void OmloxConversation::on_message(Topic, const std::shared_ptr<const LiveMessage>& message) {
  SiteSet sites;
  {
    const auto listener = listener_.lock();
    sites = listener->sites;
  }
  {
    auto output = output_.lock();
    if (output->close) return;
    for (const auto& element : message->elements)
      if (sites.holds(element.site)) output->poses[element.key] = element.json;
  }
  if (wake_) wake_();
}

void OmloxConversation::on_tick(UtcTime, bool) {
  bool stranger = false, stands = true;
  const bool ask = ++ticks_ % 5 == 0;  // four times a second, as other live connections
  {
    const auto listener = listener_.lock();
    stranger = !listener->holds;
    if (!stranger && ask) stands = listener->holds();
  }
  if (stranger && ticks_ > k_stranger_ticks) return close(4001, "auth: no token was received");
  if (!stands) return close(4001, "auth");
  bool waits = false;
  {
    const auto output = output_.lock();
    waits = !output->close && !output->poses.empty();
  }
  if (waits && wake_) wake_();  // of a flight that was not known yet
}

void OmloxConversation::on_bye(std::uint16_t code, std::string_view reason) { close(code, reason); }

void OmloxConversation::make_messages() {
  std::vector<OmloxLocation> locations;
  {
    auto output = output_.lock();
    std::erase_if(output->poses, [&](const auto& pose) {
      if (!locations_.known(pose.first)) return false;
      if (auto one = locations_.location(*pose.second)) locations.push_back(std::move(*one));
      return true;
    });
  }
  const UtcTime now = hub_.clock().now();
  for (const auto& [id, what] : subscriptions_) {
    Ordered payload = Ordered::array();
    for (const auto& one : locations) {
      if (!what.accepts(one)) continue;
      auto json = omlox_location_json(one, now);
      payload.push_back(what.geojson ? omlox_feature(std::move(json)) : std::move(json));
    }
    if (payload.empty()) continue;
    if (what.geojson) {
      Ordered collection{{"type", "FeatureCollection"}};
      collection["features"] = std::move(payload);
      payload = Ordered::array();
      payload.push_back(std::move(collection));
    }
    Ordered message{{"event", "message"}, {"topic", what.topic}, {"subscription_id", id}};
    message["payload"] = std::move(payload);
    messages_.emplace_back(id, to_wire(message));
  }
}

std::shared_ptr<const std::string> OmloxConversation::next_frame() {
  bool closing = false;
  {
    auto output = output_.lock();
    if (!output->replies.empty()) {
      auto out = std::make_shared<const std::string>(std::move(output->replies.front()));
      output->replies.pop_front();
      return out;
    }
    closing = output->close.has_value();
  }
  if (closing) return nullptr;
  if (messages_.empty()) make_messages();
  if (messages_.empty()) return nullptr;
  auto out = std::make_shared<const std::string>(std::move(messages_.front().second));
  messages_.pop_front();
  return out;
}

std::optional<std::pair<std::uint16_t, std::string>> OmloxConversation::close_request() {
  const auto output = output_.lock();
  return output->close;
}

}  // namespace anchord::api
