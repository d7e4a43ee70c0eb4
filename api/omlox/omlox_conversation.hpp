#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "api/stream/hub.hpp"
#include "api/stream/ws_handler.hpp"
#include "core/base/locked.hpp"

namespace anchord::api {

class OmloxLocations;
struct OmloxLocation;

/// The WebSocket of an omlox hub, to one client: subscribe and unsubscribe in; subscribed, unsubscribed,
/// message and error out. Topics location_updates and location_updates:geojson; a client that is slow gets
/// the newest of each flight, of the flights that its token may see. Who has not come in by a token within k_stranger_ticks is let go.
class OmloxConversation final : public WsHandler, private HubListener {
 public:
  static constexpr std::size_t k_max_subscriptions = 32;
  static constexpr std::size_t k_max_replies = 64;    ///< that wait; beyond: closed
  static constexpr unsigned k_stranger_ticks = 200;   ///< of 50 ms
  static constexpr unsigned k_most_wrong_tokens = 3;  ///< then closed

  OmloxConversation(Hub& hub, const OmloxLocations& locations, Listener first, TokenDoor door);
  ~OmloxConversation() override;

  void on_open(std::function<void()> wake) override;
  void on_text(std::string_view message) override;
  void on_close() override;
  std::shared_ptr<const std::string> next_frame() override;
  std::optional<std::pair<std::uint16_t, std::string>> close_request() override;

 private:
  /// What one subscription wants; absent: everything.
  struct Wanted {
    bool geojson{false};
    std::string topic;
    std::optional<std::string> provider_id{}, provider_type{}, source{};
    std::optional<double> accuracy_m{};
    bool accepts(const OmloxLocation& location) const;
  };
  struct Output {
    std::deque<std::string> replies;
    std::map<std::string, std::shared_ptr<const std::string>> poses;  ///< newest of each flight
    std::optional<std::pair<std::uint16_t, std::string>> close;
  };
  void on_message(Topic topic, const std::shared_ptr<const LiveMessage>& message) override;
  void on_tick(UtcTime now, bool heartbeat) override;
  void on_bye(std::uint16_t code, std::string_view reason) override;

  void subscribe(const nlohmann::json& message);
  void unsubscribe(const nlohmann::json& message);
  bool let_in(const nlohmann::json& message);
  std::optional<Wanted> wanted(const nlohmann::json& message);
  void refuse(int code, std::string_view why);
  void reply(std::string text);
  void close(std::uint16_t code, std::string_view reason);
  /// Turns poses into messages for the subscriptions; what is of an unknown flight waits.
  void make_messages();

  Hub& hub_;
  const OmloxLocations& locations_;
  const TokenDoor door_;
  std::function<void()> wake_;
  Locked<Listener> listener_;
  Locked<Output> output_;  ///< taken inside the hub's lock, so never held while the hub is called
  // Touched by the session's strand alone.
  std::map<std::uint64_t, Wanted> subscriptions_;
  std::deque<std::pair<std::uint64_t, std::string>> messages_;  ///< made, not yet sent, by subscription
  std::uint64_t next_id_{1};
  unsigned wrong_tokens_{0};
  unsigned ticks_{0};         ///< of the hub; touched under its lock alone
  HubMembership membership_;  ///< from on_open to on_close; last, so that it ends before what the hub calls
};

}  // namespace anchord::api
