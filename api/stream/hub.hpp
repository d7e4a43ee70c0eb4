#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/site_set.hpp"
#include "core/base/time.hpp"

namespace anchord::api {

/// How a topic treats a client that cannot keep up (api.md section 9).
enum class TopicClass : std::uint8_t {
  state,   ///< newest per key is kept, the rest conflated
  stream,  ///< oldest dropped, and said so with a gap
  event,   ///< kept in order, or the connection is closed
};

enum class Topic : std::uint8_t {
  alarms,
  anchors_estimates,
  devices,
  drone_pose,
  events,
  fixes,
  jobs,
  mission_state,
  ranges,
  revisions,
  rtk_status,
  system,
  mission_grid,
  mission_height,
  mission_turn,
  procedure,
};
inline constexpr std::size_t k_topic_count = 16;

struct TopicInfo {
  Topic topic;
  std::string_view name;
  TopicClass cls;
  bool keyed;  ///< a snap is an array of the newest object per key; otherwise the newest object itself
};
const std::array<TopicInfo, k_topic_count>& topics();
const TopicInfo& info(Topic topic);
const TopicInfo* find_topic(std::string_view name);

/// A page calls its link late when the newest heartbeat is two seconds old: on a slow link, where one waits
/// for a part of a second behind what is larger, there must be time for the next.
inline constexpr std::int64_t k_heartbeat_us = 500'000;

/// One JSON object on its way to many clients; encoded once, shared by reference.
struct LiveElement {
  std::string key;                    ///< of a state topic
  std::optional<NetworkId> anchor{};  ///< for params.anchors
  std::shared_ptr<const std::string> json;
  std::optional<SiteId> site{};  ///< of its mission; none: for those who see all sites
  /// Of what is of many sites at once: what of it is for a client that sees these; else null.
  std::function<std::string(const SiteSet&)> part{};
};

/// What one publish() made: its number in the topic and its elements.
struct LiveMessage {
  std::uint64_t seq{};
  std::int64_t t_us{};
  std::vector<LiveElement> elements;
  /// The whole data frame for subscription `default_sub(topic)` whose last seq was seq - 1: what nearly every
  /// subscriber gets, so the bytes are shared.
  std::shared_ptr<const std::string> frame;
  std::size_t bytes() const;
};
/// Number of the first subscription of a topic on every connection.
constexpr std::uint64_t default_sub(Topic topic) { return static_cast<std::uint64_t>(topic) + 1; }

/// Receives what is published to its subscriptions. Called with the hub's lock held: enqueue, wake, return.
class HubListener {
 public:
  virtual ~HubListener() = default;
  virtual void on_message(Topic topic, const std::shared_ptr<const LiveMessage>& message) = 0;
  virtual void on_tick(UtcTime now, bool heartbeat) = 0;
  virtual void on_bye(std::uint16_t code, std::string_view reason) = 0;
};

class Hub;
struct Resumed;

/// One listener's place among the clients of a hub: as long as it lives the listener is told, and nobody
/// without one can subscribe. Its end takes the listener out of everything, and waits for a call that is
/// under way; never end it inside a call of the hub to this listener. One thread at a time.
class HubMembership {
 public:
  HubMembership() = default;
  HubMembership(HubMembership&& other) noexcept;
  HubMembership& operator=(HubMembership&& other) noexcept;
  ~HubMembership();

  explicit operator bool() const { return hub_ != nullptr; }
  Resumed subscribe(Topic topic, const std::optional<std::pair<std::string, std::uint64_t>>& since);
  void unsubscribe(Topic topic);

 private:
  friend class Hub;
  HubMembership(Hub& hub, HubListener& listener) : hub_(&hub), listener_(&listener) {}
  Hub* hub_{nullptr};
  HubListener* listener_{nullptr};
};

struct HubCounters {
  std::atomic<std::uint64_t> dropped{0}, conflated{0}, slow_disconnects{0}, published{0};
};

/// What a new subscription starts from.
struct Resumed {
  bool recovered{false};
  std::uint64_t last_seq{};                                ///< newest seq of the topic at this instant
  std::vector<std::shared_ptr<const LiveMessage>> missed;  ///< after `since`, when recovered
  std::vector<LiveElement> snapshot;                       ///< otherwise
  std::int64_t t_us{};
};

/// The event bus: topics with sequence numbers, history and snapshots. No producer ever waits for a client;
/// every client has its own bounded outbox. Thread-safe; locks in the order hub, then outbox.
class Hub {
 public:
  static constexpr std::size_t k_event_history = 10'000;
  static constexpr std::int64_t k_stream_history_us = 30'000'000;
  static constexpr std::size_t k_stream_history_bytes = 8u << 20;

  Hub(const Clock& clock, std::string server_name);

  const std::string& epoch() const { return epoch_; }
  const std::string& server_name() const { return server_name_; }
  const Clock& clock() const { return clock_; }

  /// Whom what is published of a mission is for, from now on.
  void mission_is_of(const MissionId& mission, const std::optional<SiteId>& site);
  std::optional<SiteId> site_of(const MissionId& mission) const;
  /// Sends one object now. `json` is a complete JSON value; `mission`: what it is of, for those who see only
  /// some sites.
  void publish(Topic topic, std::string json, std::int64_t t_us, std::string key = {},
               std::optional<NetworkId> anchor = {}, const std::optional<MissionId>& mission = {});
  /// Sends an object of many missions now: `json` whole, or, to who sees only some sites, what `part` makes
  /// of it.
  void publish_parts(Topic topic, std::string json, std::int64_t t_us,
                     std::function<std::string(const SiteSet&)> part);
  /// Collects an element of a stream; tick() sends them together, at most 20 frames a second.
  void collect(Topic topic, std::string json, std::int64_t t_us, const MissionId& mission,
               std::optional<NetworkId> anchor = {});
  /// Forgets a key of a state topic (a removed mission).
  void forget(Topic topic, const std::string& key);

  /// The newest element of each key of a state topic, for who asks now and then instead of listening; nothing
  /// while the topic has had no message since number `seen`.
  struct Newest {
    std::uint64_t seq{};
    std::vector<LiveElement> elements;
  };
  std::optional<Newest> newest(Topic topic, std::uint64_t seen) const;

  /// How many may come is decided where connections are accepted (ws.max_connections), not here.
  [[nodiscard]] HubMembership join(HubListener& listener);

  /// Every 50 ms: sends what was collected; wakes clients with due frames; a heartbeat twice a second.
  void tick();
  /// Tells every client to go (4010).
  void shut_down();

  std::size_t clients() const;
  HubCounters& counters() { return counters_; }

 private:
  friend class HubMembership;
  void leave(HubListener& listener);
  Resumed subscribe(HubListener& listener, Topic topic,
                    const std::optional<std::pair<std::string, std::uint64_t>>& since);
  void unsubscribe(HubListener& listener, Topic topic);
  struct Channel {
    std::uint64_t seq{0};
    std::deque<std::shared_ptr<const LiveMessage>> history;
    std::deque<std::int64_t> history_at_us;
    std::size_t history_bytes{0};
    std::map<std::string, std::pair<LiveElement, std::int64_t>> newest;
    std::vector<LiveElement> collected;
    std::int64_t collected_t_us{0};
    std::map<HubListener*, std::size_t> listeners;  ///< with the number of their subscriptions
  };
  struct Bus {
    Channel& of(Topic topic) { return channels[static_cast<std::size_t>(topic)]; }
    const Channel& of(Topic topic) const { return channels[static_cast<std::size_t>(topic)]; }
    std::array<Channel, k_topic_count> channels{};
    std::set<HubListener*> connections{};
    std::map<MissionId, SiteId> sites{};  ///< of the missions that have one
    std::optional<SiteId> site_of(const std::optional<MissionId>& mission) const;
    std::int64_t last_heartbeat_us{0};
    bool closed{false};
  };
  void send(Bus& bus, Topic topic, std::vector<LiveElement> elements, std::int64_t t_us);
  static void trim(const TopicInfo& topic, Channel& channel);

  const Clock& clock_;
  std::string server_name_, epoch_;
  Locked<Bus> bus_;
  HubCounters counters_;
};

}  // namespace anchord::api
