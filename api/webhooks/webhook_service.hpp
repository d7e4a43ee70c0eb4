#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "api/admin/event_log.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/types/webhook.hpp"

namespace anchord {
class WebhookStore;
class WebPost;
}  // namespace anchord

namespace anchord::api {

/// Seconds from one attempt to the next: five attempts within a day. Of running time: while the laptop is off
/// nothing is due.
inline const std::vector<double> k_webhook_waits_s{30, 600, 7200, 72000};

/// Sends events to the webhooks that asked for them: at least once, in order of their time where nothing
/// fails. An event waits in memory for the moment its row takes to be written; from then on it survives the
/// process. The thread is there while there is an enabled webhook. Thread-safe.
class WebhookService {
 public:
  struct Deps {
    WebhookStore& store;
    WebPost* post;  ///< null: nobody is told
    const Clock& clock;
    std::function<std::int64_t()> running_ns;
    std::vector<double> waits_s{k_webhook_waits_s};
  };
  explicit WebhookService(Deps deps) : deps_(std::move(deps)) {}
  ~WebhookService() { stop(); }

  /// Reads what is stored and begins; also after every change of a webhook.
  void changed();
  /// Ends the exchange that runs; what was not sent is sent after the next start.
  void stop();

  /// Called for every event, from any thread; waits for neither disk nor network.
  void notify(const LiveEvent& event);
  /// Puts one test event into the outbox, for this webhook alone.
  Result<WebhookDelivery> test(const Webhook& webhook);
  /// Events that found the queue to the outbox full.
  std::uint64_t dropped() const {
    const auto state = state_.lock();
    return state->dropped;
  }

 private:
  struct State {
    std::vector<Webhook> enabled;
    std::deque<WebhookDelivery> fresh;  ///< not in the outbox yet
    bool look{false};                   ///< something changed: make a round
    bool running{false};                ///< the thread
    bool stopped{false};                ///< for good
    std::uint64_t dropped{0};
  };
  WebhookDelivery delivery(const Webhook& webhook, const LiveEvent& event) const;
  void run();
  /// Moves fresh ones to the outbox, makes what is due; nanoseconds until there is something to do.
  std::int64_t round();
  void attempt(const Webhook& webhook, WebhookDelivery delivery);
  bool stopped() const {
    const auto state = state_.lock();
    return state->stopped;
  }
  /// Whether the thread is to end, which it then has: nobody is to be notified, or the server stops.
  bool ended();

  Deps deps_;
  mutable Locked<State> state_;
  std::condition_variable wake_;
  std::mutex starting_;  ///< the thread is begun or joined
  Thread thread_;
};

}  // namespace anchord::api
