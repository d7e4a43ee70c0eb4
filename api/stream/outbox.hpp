#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "api/stream/hub.hpp"
#include "api/stream/unseen.hpp"
#include "core/base/site_set.hpp"

namespace anchord::api {

/// One subscription of one connection.
struct Subscription {
  std::uint64_t id{};
  Topic topic{};
  std::set<NetworkId> anchors{};    ///< empty: all
  SiteSet sites{};                  ///< what of the topic the client may see
  std::int64_t min_interval_us{0};  ///< of max_hz
  std::int64_t max_age_us{0};  ///< of max_age_s: what of a stream has waited longer is dropped; 0: nothing
  /// Of a state topic: only what changed since the last frame, at most k_delta_bytes_per_s.
  bool deltas{false};
  std::uint64_t last_seq{0};  ///< last seq this subscription was sent, for `prev`

  bool wants(const LiveElement& element) const {
    return (element.part || sites.holds(element.site)) &&
           (anchors.empty() || !element.anchor || anchors.count(*element.anchor) > 0);
  }
  /// One that it wants, as this client may see it.
  LiveElement seen(const LiveElement& element) const {
    LiveElement out = element;
    if (element.part && !sites.all()) out.json = std::make_shared<const std::string>(element.part(sites));
    return out;
  }
};

/// What waits for one client, by the three rules of TopicClass. At most 1 MiB or 512 messages of streams,
/// events and control; state is bounded by its number of keys. Not thread-safe: the conversation locks it.
class Outbox {
 public:
  static constexpr std::size_t k_max_bytes = 1u << 20, k_max_messages = 512;
  /// With the frame that a window of some 20 s begins with, 30 kB/s.
  static constexpr std::int64_t k_delta_bytes_per_s = 27'000;

  explicit Outbox(HubCounters& counters) : counters_(counters) {}

  void add(const Subscription& subscription);
  void remove(std::uint64_t sub);
  /// Where the subscription begins: `missed` is replayed first (shared with the history, so not counted); the
  /// client was shown `snapshot`. Nothing of the subscription leaves before.
  void start(std::uint64_t sub, std::uint64_t last_seq,
             const std::vector<std::shared_ptr<const LiveMessage>>& missed,
             const std::vector<LiveElement>& snapshot);
  /// Ack, snap, err, bye; goes first. False when the client must be closed (4008).
  bool control(std::string frame);
  /// False when the client must be closed: an event found no room.
  bool put(const std::shared_ptr<const LiveMessage>& message, Topic topic, std::int64_t now_us);
  /// Next frame that is due at `now_us` (monotonic enough: only differences count); null when nothing is.
  std::shared_ptr<const std::string> next(std::int64_t now_us);
  bool due(std::int64_t now_us) const;
  /// Only control frames, after a close was decided.
  std::shared_ptr<const std::string> next_control();
  /// The client has read so many frames of this connection; false where it was not sent so many.
  bool seen(std::uint64_t frames, std::int64_t now_us) { return unseen_.seen(frames, now_us); }
  /// The newest heartbeat alone waits, and tells that this connection conflates since the last one.
  void heartbeat(std::int64_t t_us);

  double fill() const;

 private:
  using Text = std::shared_ptr<const std::string>;
  struct Waiting {
    std::shared_ptr<const LiveMessage> message;
    std::int64_t since_us{};
  };
  struct Pending {
    LiveElement element;
    std::uint64_t seq{};
    std::int64_t t_us{};
  };
  struct Queue {
    Subscription subscription;
    std::map<std::string, Pending> newest;    ///< state
    std::shared_ptr<const LiveMessage> only;  ///< state: the single message pending, for its frame
    std::uint64_t conflated{0};
    std::deque<Waiting> messages;       ///< stream, event
    std::deque<Waiting> replay;         ///< what was missed; before messages
    std::map<std::string, Text> shown;  ///< of a subscription to deltas: what the client has, by key
    std::uint64_t gap_from{0}, gap_to{0}, gap_dropped{0};
    std::int64_t sent_us{INT64_MIN / 2}, due_us{INT64_MIN / 2};
    bool started{false};
  };
  bool ready(const Queue& queue, std::int64_t now_us) const;
  std::shared_ptr<const std::string> pick(std::int64_t now_us);
  Queue* next_queue(std::int64_t now_us);
  std::shared_ptr<const std::string> pick_content(std::int64_t now_us);
  void drop_oldest_stream();
  void drop_front(Queue& queue);
  void drop_aged(Queue& queue, std::int64_t now_us);
  Text take_state(Queue& queue);
  static void to_deltas(Queue& queue, std::vector<LiveElement>& elements);
  Text take_messages(Queue& queue, std::deque<Waiting>& from, bool merge);

  HubCounters& counters_;
  std::map<std::uint64_t, Queue> queues_;
  std::deque<std::string> control_;
  std::string heartbeat_;
  Unseen unseen_;
  std::size_t bytes_{0}, count_{0};
  bool conflated_since_heartbeat_{false};
};

}  // namespace anchord::api
