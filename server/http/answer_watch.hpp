#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <string>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"

namespace anchord::server {

/// Ends a call whose answer does not begin, comes a drop at a time, or floods the connection with what is no
/// body: the library reads a head of any length for as long as bytes come. On a thread of its own, for the
/// time of one call; the others are called by the thread that makes it.
class AnswerWatch {
 public:
  struct Limits {
    std::chrono::milliseconds head;  ///< from the last byte of the request to the first of the answer's body
    std::function<void()> stop;      ///< ends the call, from the watch's thread
  };
  /// `socket` is the one of the call, -1 while there is none; it may change meanwhile.
  AnswerWatch(const std::atomic<int>& socket, Limits limits);
  ~AnswerWatch();
  AnswerWatch(const AnswerWatch&) = delete;
  AnswerWatch& operator=(const AnswerWatch&) = delete;

  void sent();
  void begun();
  void received(std::uint64_t bytes);
  /// Why it ended the call; empty: it did not.
  std::string why() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Call {
    bool over{false}, begun{false};
    Clock::time_point since{Clock::now()};  ///< the last byte of the request; then the window's beginning
    std::uint64_t bytes{}, window_bytes{};  ///< of the body, in all and in this window
    int socket{-1};
    std::uint64_t before{};  ///< bytes of this connection before the call
    std::string why{};
  };
  void run();
  std::string fault(Call& call) const;

  const std::atomic<int>& socket_;
  const Limits limits_;
  mutable Locked<Call> call_;
  std::condition_variable changed_;
  Thread thread_;
};

}  // namespace anchord::server
