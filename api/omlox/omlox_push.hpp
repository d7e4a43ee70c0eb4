#pragma once

#include <nlohmann/json_fwd.hpp>
#include <set>
#include <string>

#include "api/webhooks/webhook_service.hpp"
#include "core/base/locked.hpp"

namespace anchord {
class PlaceStore;
}

namespace anchord::api {

struct AnchorApi;
class OmloxLocations;

/// Makes and changes what a hub has of this server: zones and providers one by one, locations together.
/// Zones are found again by their id, or, since hubs of the official dialect give ids of their own, by the id
/// in properties.anchord. On the threads of webhooks.
class OmloxPush final : public HubSender {
 public:
  struct Deps {
    AnchorApi& anchors;
    PlaceStore& places;
    OmloxLocations& locations;
    WebPost* post;  ///< null: nothing is sent
  };
  explicit OmloxPush(Deps deps) : deps_(deps) {}

  Result<Sent> send_zones(const Webhook& hub) override;
  Result<Sent> send_locations(const Webhook& hub, const std::string& body) override;
  std::string newest_locations() override;

 private:
  /// One request; `what` of a fault is its method and path.
  struct Reply {
    int status{};
    std::string body, what;
    bool good() const { return status / 100 == 2; }
    Sent sent() const;
  };
  Result<Reply> ask(const Webhook& hub, const char* method, const std::string& path, std::string body = {});
  /// GET, then PUT of what is there, POST of what is not.
  Result<Sent> make_or_change(const Webhook& hub, const std::string& list, nlohmann::ordered_json object);
  Result<Sent> change(const Webhook& hub, const std::string& list, const nlohmann::ordered_json& object);
  /// Under which id a hub keeps our zone; empty: it has none.
  Result<std::string> kept_as(const Webhook& hub, const nlohmann::ordered_json& zone, Reply& reply);
  Result<Sent> send_providers(const Webhook& hub, const nlohmann::ordered_json& providers);
  /// Has them made anew the next time.
  void forget(const Webhook& hub, const nlohmann::ordered_json& providers);

  Deps deps_;
  Locked<std::set<std::string>> made_;  ///< providers, by hub and its version
};

}  // namespace anchord::api
