#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
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

/// Speaks to omlox hubs (api/omlox). Blocks; thread-safe.
class HubSender {
 public:
  struct Sent {
    int status{};       ///< of the last answer
    std::string fault;  ///< empty: the hub took everything
  };
  virtual ~HubSender() = default;
  /// Everything that is published, made or changed there. Errors: those of WebPost.
  virtual Result<Sent> send_zones(const Webhook& hub) = 0;
  /// `body`: what newest_locations() once gave.
  virtual Result<Sent> send_locations(const Webhook& hub, const std::string& body) = 0;
  /// Of each provider, as a JSON array; empty: there is none.
  virtual std::string newest_locations() = 0;
};

/// How the newest live locations went to a hub.
struct HubLive {
  std::uint64_t taken{0};  ///< since the server started
  UtcTime tried{};
  std::optional<int> status{};
  std::string fault;  ///< why the newest attempt failed; empty: it did not
};

/// Sends events to the webhooks that asked for them: at least once, in order of their time where nothing
/// fails. An event waits in memory for the moment its row takes to be written; from then on it survives the
/// process. One thread writes the outbox, and each enabled webhook has one that sends: a slow receiver delays
/// nobody else's. They are there while they have something to do. Thread-safe.
class WebhookService {
 public:
  struct Deps {
    WebhookStore& store;
    WebPost* post;  ///< null: nobody is told
    const Clock& clock;
    std::function<std::int64_t()> running_ns;
    std::vector<double> waits_s{k_webhook_waits_s};
    HubSender* hubs{nullptr};  ///< null: there are no omlox hubs
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
  /// Nothing where no live location was sent yet.
  std::optional<HubLive> live(const WebhookId& hub) const;
  /// Events that found the queue to the outbox full.
  std::uint64_t dropped() const {
    const auto state = state_.lock();
    return state->dropped;
  }

 private:
  struct State {
    std::vector<Webhook> enabled;
    std::deque<WebhookDelivery> fresh;  ///< not in the outbox yet
    std::uint64_t news{0};              ///< counts what may make a round worth while
    bool running{false};                ///< the thread that writes the outbox
    std::set<WebhookId> sending;        ///< whose thread runs
    bool stopped{false};                ///< for good
    std::uint64_t dropped{0};
    std::map<WebhookId, HubLive> live;
  };
  /// What became of one attempt.
  struct Tried {
    std::optional<int> status;
    std::string fault;  ///< empty: it was taken
    bool canceled{false};
  };
  /// Of one hub, what its thread knows.
  struct Hub {
    std::string sent, kept;  ///< locations that it took; that wait in the outbox
    std::int64_t due_ns{0};
    int failures{0};           ///< in a row
    std::uint64_t version{0};  ///< of the webhook
  };
  /// One webhook and the thread that sends to it.
  struct Lane {
    Hub hub;  ///< touched by the thread alone
    Thread thread;
  };
  /// What a round begins with.
  struct Turn {
    Webhook webhook;
    std::uint64_t news{};
  };
  WebhookDelivery delivery(const Webhook& webhook, const LiveEvent& event) const;
  /// Starts threads that are missing and collects those that ended; under starting_.
  void begin_threads();
  /// Moves fresh events to the outbox until there is nobody to notify.
  void run();
  /// Whether there is nothing left to move for now; else the database takes nothing.
  bool store_fresh();
  void run_lane(const WebhookId& id, Lane& lane);
  /// Makes what is due; nanoseconds until there is something to do.
  std::int64_t round(const Webhook& webhook, Hub& known);
  void attempt(const Webhook& webhook, Hub& known, WebhookDelivery delivery);
  Tried send_event(const Webhook& webhook, const WebhookDelivery& delivery, UtcTime now);
  Tried send_to_hub(const Webhook& hub, Hub& known, const WebhookDelivery& delivery);
  static Tried tried(const Result<HubSender::Sent>& sent);
  /// Sends a hub the newest locations, once a second while they change; nanoseconds until the next.
  std::int64_t live_round(const Webhook& hub, Hub& known);
  void send_live(const Webhook& hub, Hub& known, const std::string& body);
  /// Into the outbox, so that what a hub could not take outlives the process.
  void keep(const Webhook& hub, Hub& known, const std::string& body, const Tried& why);
  void keep_unsent();
  bool stopped() const {
    const auto state = state_.lock();
    return state->stopped;
  }
  /// Whether the thread of the outbox is to end, which it then has: nobody is to be notified, or the server
  /// stops.
  bool ended();
  /// The same for the thread of a webhook: nothing where it is to end.
  std::optional<Turn> turn_of(const WebhookId& id);

  Deps deps_;
  mutable Locked<State> state_;
  std::condition_variable wake_;
  std::mutex starting_;                               ///< threads are begun or joined
  std::map<WebhookId, std::unique_ptr<Lane>> lanes_;  ///< under starting_
  Thread thread_;
};

}  // namespace anchord::api
