#include "server/app/live_peer.hpp"

#include <utility>

namespace anchord::server {
namespace {

class LivePeer final : public WsPeer {
 public:
  explicit LivePeer(std::unique_ptr<api::WsHandler> handler) : handler_(std::move(handler)) {}
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
  std::unique_ptr<api::WsHandler> handler_;
  bool refused_binary_{false};
};

}  // namespace

std::unique_ptr<WsPeer> make_live_peer(std::unique_ptr<api::WsHandler> handler) {
  return std::make_unique<LivePeer>(std::move(handler));
}

}  // namespace anchord::server
