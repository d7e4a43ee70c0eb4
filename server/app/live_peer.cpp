#include "server/app/live_peer.hpp"

#include <utility>

namespace anchord::server {
namespace {

class LivePeer final : public WsPeer {
 public:
  LivePeer(std::unique_ptr<api::WsHandler> handler, std::shared_ptr<void> place)
      : place_(std::move(place)), handler_(std::move(handler)) {}
  void on_open(std::function<void()> wake) override { handler_->on_open(std::move(wake)); }
  void on_message(std::string_view bytes, bool binary) override {
    if (binary) {
      refused_binary_ = true;
    } else if (!refused_binary_) {
      handler_->on_text(bytes);
    }
  }
  void on_close() override { handler_->on_close(); }
  WsFrame next_frame() override { return {refused_binary_ ? nullptr : handler_->next_frame(), false}; }
  std::optional<std::pair<std::uint16_t, std::string>> close_request() override {
    if (refused_binary_) return std::pair<std::uint16_t, std::string>{1003, "text messages only"};
    return handler_->close_request();
  }

 private:
  std::shared_ptr<void> place_;
  std::unique_ptr<api::WsHandler> handler_;
  bool refused_binary_{false};
};

class RefusingPeer final : public WsPeer {
 public:
  RefusingPeer(std::uint16_t code, std::string reason) : why_(code, std::move(reason)) {}
  void on_open(std::function<void()>) override {}
  void on_message(std::string_view, bool) override {}
  void on_close() override {}
  WsFrame next_frame() override { return {}; }
  std::optional<std::pair<std::uint16_t, std::string>> close_request() override { return why_; }

 private:
  const std::pair<std::uint16_t, std::string> why_;
};

}  // namespace

std::unique_ptr<WsPeer> make_live_peer(std::unique_ptr<api::WsHandler> handler, std::shared_ptr<void> place) {
  return std::make_unique<LivePeer>(std::move(handler), std::move(place));
}

std::unique_ptr<WsPeer> make_refusing_peer(std::uint16_t code, std::string reason) {
  return std::make_unique<RefusingPeer>(code, std::move(reason));
}

}  // namespace anchord::server
