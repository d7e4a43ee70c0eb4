#include "api/omlox/omlox_push.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/kit/problem.hpp"
#include "api/kit/support.hpp"
#include "api/omlox/omlox_locations.hpp"
#include "api/omlox/omlox_zone.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/web_post.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_most_providers = 50;  ///< that a revision brings along; others with their locations
constexpr std::size_t k_most_made = 1000;

std::string url_of(const Webhook& hub, const std::string& path) {
  std::string out = hub.url;
  while (out.ends_with('/')) out.pop_back();
  return out + path;
}

/// Our id of a zone, as a hub has kept it for us.
std::string our_id(const Json& zone) {
  static const Json::json_pointer at("/properties/anchord/zone");
  return zone.is_object() && zone.contains(at) && zone[at].is_string() ? zone[at].get<std::string>() : "";
}

std::string made_key(const Webhook& hub, const std::string& provider) {
  return to_string(hub.id) + '/' + std::to_string(hub.version) + '/' + provider;
}

}  // namespace

HubSender::Sent OmloxPush::Reply::sent() const {
  if (good()) return {status, ""};
  return {status, what + " answered " + std::to_string(status) +
                      (status / 100 == 3 ? "; redirects are not followed" : "")};
}

Result<OmloxPush::Reply> OmloxPush::ask(const Webhook& hub, const char* method, const std::string& path,
                                        std::string body) {
  if (deps_.post == nullptr) return make_error(Errc::unsupported, "this server sends nothing");
  WebPost::Message message{url_of(hub, path),
                           {{"User-Agent", "anchord"}, {"Accept", "application/json"}},
                           std::move(body),
                           method};
  if (!message.body.empty()) message.headers.emplace_back("Content-Type", "application/json");
  if (!hub.token.empty()) message.headers.emplace_back("Authorization", "Bearer " + hub.token);
  BOOST_OUTCOME_TRY(auto answer, deps_.post->send(message));
  return Reply{answer.status, std::move(answer.body), method + (' ' + path)};
}

Result<HubSender::Sent> OmloxPush::change(const Webhook& hub, const std::string& list,
                                          const Ordered& object) {
  const auto path = list + '/' + percent_encoded(object["id"].get<std::string>());
  BOOST_OUTCOME_TRY(const auto reply, ask(hub, "PUT", path, to_wire(object)));
  return reply.sent();
}

Result<std::string> OmloxPush::kept_as(const Webhook& hub, const Ordered& zone, Reply& reply) {
  const auto foreign = percent_encoded(zone["foreign_id"].get<std::string>());
  BOOST_OUTCOME_TRY(reply, ask(hub, "GET", "/zones/summary?foreign_id=" + foreign));
  if (!reply.good()) return std::string();
  const Json all = Json::parse(reply.body, nullptr, false);
  if (!all.is_array())
    return make_error(Errc::bad_frame,
                      reply.what + " did not answer with a list of zones, or with more than 1 MiB");
  const auto at = std::ranges::find_if(all, [&](const Json& one) { return our_id(one) == zone["id"]; });
  return at == all.end() ? std::string() : at->value("id", std::string());
}

Result<HubSender::Sent> OmloxPush::make_or_change(const Webhook& hub, const std::string& list,
                                                  Ordered object) {
  const auto id = object["id"].get<std::string>();
  BOOST_OUTCOME_TRY(auto reply, ask(hub, "GET", list + '/' + percent_encoded(id)));
  if (reply.good()) return change(hub, list, object);
  if (reply.status != 404) return reply.sent();
  if (list == "/zones" && hub.dialect == OmloxDialect::official) {
    BOOST_OUTCOME_TRY(const auto other, kept_as(hub, object, reply));
    if (!reply.good() && reply.status != 404) return reply.sent();
    if (!other.empty()) {
      object["id"] = other;
      return change(hub, list, object);
    }
  }
  BOOST_OUTCOME_TRY(reply, ask(hub, "POST", list, to_wire(object)));
  // Somebody made it meanwhile.
  if (reply.status == 409) return change(hub, list, object);
  return reply.sent();
}

Result<HubSender::Sent> OmloxPush::send_providers(const Webhook& hub, const Ordered& providers) {
  Sent last{204, ""};
  for (const auto& one : providers) {
    const auto key = made_key(hub, one["id"].get<std::string>());
    {
      const auto made = made_.lock();
      if (made->contains(key)) continue;
    }
    BOOST_OUTCOME_TRY(last, make_or_change(hub, "/providers", one));
    if (!last.fault.empty()) return last;
    auto made = made_.lock();
    if (made->size() >= k_most_made) made->clear();
    made->insert(key);
  }
  return last;
}

void OmloxPush::forget(const Webhook& hub, const Ordered& providers) {
  auto made = made_.lock();
  for (const auto& one : providers) made->erase(made_key(hub, one["id"].get<std::string>()));
}

Result<HubSender::Sent> OmloxPush::send_zones(const Webhook& hub) {
  std::vector<OmloxZone> zones;
  try {
    zones = omlox_zones(deps_.anchors, deps_.places);
  } catch (const ProblemException&) {
    return make_error(Errc::storage_unavailable, "the published anchors could not be read");
  }
  std::optional<Sent> last;
  for (const auto& zone : zones) {
    BOOST_OUTCOME_TRY(last, make_or_change(hub, "/zones", omlox_zone_json(zone, hub.dialect)));
    if (!last->fault.empty()) return *last;
  }
  Ordered providers = Ordered::array();
  for (const auto& one : deps_.locations.providers()) {
    if (providers.size() < k_most_providers) providers.push_back(omlox_provider_json(one));
  }
  // Once more, although they were made: who asks for everything gets everything.
  forget(hub, providers);
  if (!providers.empty()) {
    BOOST_OUTCOME_TRY(last, send_providers(hub, providers));
  }
  if (last) return *last;
  BOOST_OUTCOME_TRY(const auto reply, ask(hub, "GET", "/zones"));  // nothing to send: does it answer?
  return reply.sent();
}

Result<HubSender::Sent> OmloxPush::send_locations(const Webhook& hub, const std::string& body) {
  const Ordered locations = Ordered::parse(body, nullptr, false);
  if (!locations.is_array()) return Sent{0, "the stored text is not a list of locations"};
  Ordered providers = Ordered::array();
  for (const auto& one : locations) {
    providers.push_back(Ordered{{"id", one.value("provider_id", std::string())},
                                {"type", one.value("provider_type", std::string("unknown"))},
                                {"name", one.value("provider_id", std::string())}});
  }
  for (const auto& known : deps_.locations.providers()) {
    for (auto& one : providers) {
      if (one["id"] == known.id) one = omlox_provider_json(known);
    }
  }
  BOOST_OUTCOME_TRY(auto made, send_providers(hub, providers));
  if (!made.fault.empty()) return made;
  const char* method = hub.dialect == OmloxDialect::objects ? "POST" : "PUT";
  BOOST_OUTCOME_TRY(const auto reply, ask(hub, method, "/providers/locations", body));
  // It has forgotten them, perhaps: they are made anew the next time.
  if (!reply.good()) forget(hub, providers);
  return reply.sent();
}

std::string OmloxPush::newest_locations() {
  Ordered out = Ordered::array();
  for (const auto& one : deps_.locations.newest()) {
    auto location = omlox_location_json(one, one.time);
    location.erase("timestamp_sent");  // the same place is the same text
    location.erase("trackables");      // which the hub does not have of us
    out.push_back(std::move(location));
  }
  return out.empty() ? std::string() : to_wire(out);
}

}  // namespace anchord::api
