#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>

#include "api/stream/hub.hpp"
#include "api/stream/outbox.hpp"
#include "api/stream/ws_handler.hpp"
#include "core/base/locked.hpp"

namespace anchord::api {

/// The `anchord.v1` protocol of one client (api.md section 9): sub, unsub, seen, time in; hello, ack, snap,
/// data, gap, hb, err, bye out.
class Conversation final : public WsHandler, private HubListener {
 public:
  static constexpr std::size_t k_max_subscriptions = 32;

  /// `holds`: false ends the conversation with 4001; empty: it always does (tests).
  Conversation(Hub& hub, Principal principal, std::function<bool()> holds = {});
  ~Conversation() override;

  void on_open(std::function<void()> wake) override;
  void on_text(std::string_view message) override;
  void on_close() override;
  std::shared_ptr<const std::string> next_frame() override;
  std::optional<std::pair<std::uint16_t, std::string>> close_request() override;

 private:
  void on_message(Topic topic, const std::shared_ptr<const LiveMessage>& message) override;
  void on_tick(UtcTime now, bool heartbeat) override;
  void on_bye(std::uint16_t code, std::string_view reason) override;

  void subscribe(const nlohmann::json& message);
  void unsubscribe(const nlohmann::json& message);
  void seen(const nlohmann::json& message);
  void refuse(const nlohmann::json& message, int status, std::string_view type, std::string_view detail);
  void send(std::string frame);
  void close(std::uint16_t code, std::string_view reason);

  struct Output {
    explicit Output(HubCounters& counters) : outbox(counters) {}
    Outbox outbox;
    std::optional<std::pair<std::uint16_t, std::string>> close;
  };

  Hub& hub_;
  const Principal principal_;
  const std::function<bool()> holds_;
  std::function<void()> wake_;
  Locked<Output> output_;  ///< taken inside the hub's lock, so never held while the hub is called
  std::map<std::uint64_t, Topic> subscriptions_;  ///< touched by the session's strand alone
  std::uint64_t next_sub_{100};
  unsigned ticks_{0};         ///< of the hub; touched under its lock alone
  HubMembership membership_;  ///< from on_open to on_close; last, so that it ends before what the hub calls
};

}  // namespace anchord::api
