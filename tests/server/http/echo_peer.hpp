#pragma once

#include <deque>
#include <memory>
#include <string>

#include "server/http/gateway.hpp"

namespace anchord::test {

/// Sends every message back as it came. Bounded: beyond 64 waiting messages it asks for close 4008.
class EchoPeer final : public server::WsPeer {
 public:
  void on_open(std::function<void()>) override {}
  void on_message(std::string_view bytes, bool binary) override {
    if (waiting_.size() >= 64) {
      too_slow_ = true;
      return;
    }
    waiting_.push_back({std::make_shared<const std::string>(bytes), binary});
  }
  void on_close() override {}
  server::WsFrame next_frame() override {
    if (waiting_.empty()) return {};
    server::WsFrame frame = std::move(waiting_.front());
    waiting_.pop_front();
    return frame;
  }
  std::optional<std::pair<std::uint16_t, std::string>> close_request() override {
    if (!too_slow_) return std::nullopt;
    return std::pair<std::uint16_t, std::string>{4008, "slow_consumer"};
  }

 private:
  std::deque<server::WsFrame> waiting_;
  bool too_slow_{false};
};

}  // namespace anchord::test
