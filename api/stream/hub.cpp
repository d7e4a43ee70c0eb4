#include "api/stream/hub.hpp"

#include <algorithm>

#include "api/stream/frames.hpp"
#include "api/stream/steady_us.hpp"
#include "core/base/check.hpp"
#include "core/base/steady.hpp"

namespace anchord::api {
namespace {

constexpr std::uint16_t k_bye_code = 4010;
constexpr std::string_view k_bye_reason = "shutting_down";

}  // namespace

const std::array<TopicInfo, k_topic_count>& topics() {
  static constexpr std::array<TopicInfo, k_topic_count> k_topics{{
      {Topic::alarms, "alarms", TopicClass::state, false},
      {Topic::anchors_estimates, "anchors.estimates", TopicClass::state, true},
      {Topic::devices, "devices", TopicClass::state, false},
      {Topic::drone_pose, "drone.pose", TopicClass::state, true},
      {Topic::events, "events", TopicClass::event, true},
      {Topic::fixes, "fixes", TopicClass::stream, true},
      {Topic::jobs, "jobs", TopicClass::state, true},
      {Topic::mission_state, "mission.state", TopicClass::state, true},
      {Topic::ranges, "ranges", TopicClass::stream, true},
      {Topic::revisions, "revisions", TopicClass::event, true},
      {Topic::rtk_status, "rtk.status", TopicClass::state, true},
      {Topic::system, "system", TopicClass::state, false},
      {Topic::mission_grid, "mission.grid", TopicClass::state, true},
      {Topic::mission_height, "mission.height", TopicClass::state, true},
      {Topic::mission_turn, "mission.turn", TopicClass::state, true},
      {Topic::procedure, "procedure", TopicClass::state, true},
  }};
  return k_topics;
}

const TopicInfo& info(Topic topic) { return topics()[static_cast<std::size_t>(topic)]; }

const TopicInfo* find_topic(std::string_view name) {
  for (const auto& topic : topics()) {
    if (topic.name == name) return &topic;
  }
  return nullptr;
}

std::size_t LiveMessage::bytes() const {
  std::size_t sum = 64;
  for (const auto& element : elements) sum += element.json->size() + 16;
  return sum;
}

Hub::Hub(const Clock& clock, std::string server_name)
    : clock_(clock),
      server_name_(std::move(server_name)),
      epoch_(to_string(make_uuid_v7(clock.now())).substr(0, 23)) {}

std::optional<SiteId> Hub::Bus::site_of(const std::optional<MissionId>& mission) const {
  if (!mission) return std::nullopt;
  const auto at = sites.find(*mission);
  return at == sites.end() ? std::nullopt : std::optional(at->second);
}

void Hub::mission_is_of(const MissionId& mission, const std::optional<SiteId>& site) {
  auto bus = bus_.lock();
  if (site)
    bus->sites[mission] = *site;
  else
    bus->sites.erase(mission);
}

std::optional<SiteId> Hub::site_of(const MissionId& mission) const {
  const auto bus = bus_.lock();
  return bus->site_of(mission);
}

void Hub::publish(Topic topic, std::string json, std::int64_t t_us, std::string key,
                  std::optional<NetworkId> anchor, const std::optional<MissionId>& mission) {
  LiveElement element{std::move(key), anchor, std::make_shared<const std::string>(std::move(json)), {}, {}};
  auto bus = bus_.lock();
  element.site = bus->site_of(mission);
  send(*bus, topic, {std::move(element)}, t_us);
}

void Hub::publish_parts(Topic topic, std::string json, std::int64_t t_us,
                        std::function<std::string(const SiteSet&)> part) {
  LiveElement element{{}, {}, std::make_shared<const std::string>(std::move(json)), {}, std::move(part)};
  auto bus = bus_.lock();
  send(*bus, topic, {std::move(element)}, t_us);
}

void Hub::collect(Topic topic, std::string json, std::int64_t t_us, const MissionId& mission,
                  std::optional<NetworkId> anchor) {
  LiveElement element{{}, anchor, std::make_shared<const std::string>(std::move(json)), {}, {}};
  auto bus = bus_.lock();
  element.site = bus->site_of(mission);
  auto& channel = bus->of(topic);
  channel.collected.push_back(std::move(element));
  channel.collected_t_us = t_us;
  // A bulk import makes thousands between two ticks: frames stay of a size a browser takes in one go.
  if (channel.collected.size() >= 200) send(*bus, topic, std::exchange(channel.collected, {}), t_us);
}

void Hub::forget(Topic topic, const std::string& key) {
  auto bus = bus_.lock();
  bus->of(topic).newest.erase(key);
}

std::optional<Hub::Newest> Hub::newest(Topic topic, std::uint64_t seen) const {
  const auto bus = bus_.lock();
  const auto& channel = bus->of(topic);
  if (channel.seq == seen) return std::nullopt;
  Newest out{channel.seq, {}};
  for (const auto& [key, kept] : channel.newest) out.elements.push_back(kept.first);
  return out;
}

void Hub::send(Bus& bus, Topic topic, std::vector<LiveElement> elements, std::int64_t t_us) {
  const auto& about = info(topic);
  auto& channel = bus.of(topic);
  auto message = std::make_shared<LiveMessage>();
  message->seq = ++channel.seq;
  message->t_us = t_us;
  message->elements = std::move(elements);
  if (!channel.listeners.empty()) {
    message->frame = data_frame(default_sub(topic), message->seq, message->seq - 1, t_us, message->elements,
                                about.cls == TopicClass::stream, 0);
  }
  ++counters_.published;
  if (about.cls == TopicClass::state) {
    for (const auto& element : message->elements) channel.newest[element.key] = {element, t_us};
  } else {
    channel.history.push_back(message);
    channel.history_at_us.push_back(steady_us());
    channel.history_bytes += message->bytes();
    trim(about, channel);
  }
  for (const auto& [listener, subscriptions] : channel.listeners) listener->on_message(topic, message);
}

void Hub::trim(const TopicInfo& topic, Channel& channel) {
  const std::int64_t now_us = steady_us();
  const auto too_much = [&] {
    if (topic.cls == TopicClass::event) return channel.history.size() > k_event_history;
    return now_us - channel.history_at_us.front() > k_stream_history_us ||
           channel.history_bytes > k_stream_history_bytes;
  };
  while (!channel.history.empty() && too_much()) {
    channel.history_bytes -= channel.history.front()->bytes();
    channel.history.pop_front();
    channel.history_at_us.pop_front();
  }
}

HubMembership::HubMembership(HubMembership&& other) noexcept
    : hub_(std::exchange(other.hub_, nullptr)), listener_(std::exchange(other.listener_, nullptr)) {}

HubMembership& HubMembership::operator=(HubMembership&& other) noexcept {
  HubMembership ended(std::move(*this));
  hub_ = std::exchange(other.hub_, nullptr);
  listener_ = std::exchange(other.listener_, nullptr);
  return *this;
}

HubMembership::~HubMembership() {
  if (hub_ != nullptr) hub_->leave(*listener_);
}

Resumed HubMembership::subscribe(Topic topic,
                                 const std::optional<std::pair<std::string, std::uint64_t>>& since) {
  ANCHORD_CHECK(hub_ != nullptr, "a subscription to " << info(topic).name << " without a membership");
  return hub_->subscribe(*listener_, topic, since);
}

void HubMembership::unsubscribe(Topic topic) {
  ANCHORD_CHECK(hub_ != nullptr,
                "the end of a subscription to " << info(topic).name << " without a membership");
  hub_->unsubscribe(*listener_, topic);
}

HubMembership Hub::join(HubListener& listener) {
  auto bus = bus_.lock();
  ANCHORD_CHECK(bus->connections.insert(&listener).second, "a listener joins the hub twice");
  if (bus->closed)
    listener.on_bye(k_bye_code, k_bye_reason);  // came between shut_down() and the closing door
  return {*this, listener};
}

void Hub::leave(HubListener& listener) {
  auto bus = bus_.lock();
  bus->connections.erase(&listener);
  for (auto& channel : bus->channels) channel.listeners.erase(&listener);
}

Resumed Hub::subscribe(HubListener& listener, Topic topic,
                       const std::optional<std::pair<std::string, std::uint64_t>>& since) {
  auto bus = bus_.lock();
  auto& channel = bus->of(topic);
  ++channel.listeners[&listener];
  Resumed out;
  out.last_seq = channel.seq;
  out.t_us = clock_.now().us();
  if (since && since->first == epoch_ && since->second <= channel.seq) {
    const std::uint64_t oldest = channel.history.empty() ? channel.seq + 1 : channel.history.front()->seq;
    if (since->second + 1 >= oldest) {
      out.recovered = true;
      for (const auto& message : channel.history) {
        if (message->seq > since->second) out.missed.push_back(message);
      }
      return out;
    }
  }
  if (info(topic).cls == TopicClass::state) {
    for (const auto& [key, kept] : channel.newest) {
      out.snapshot.push_back(kept.first);
      out.t_us = kept.second;
    }
  } else {
    // The tail a fresh page shows at once; the rest is asked for over REST.
    constexpr std::size_t k_tail = 100;
    const std::size_t skip = channel.history.size() > k_tail ? channel.history.size() - k_tail : 0;
    for (std::size_t i = skip; i < channel.history.size(); ++i) {
      for (const auto& element : channel.history[i]->elements) out.snapshot.push_back(element);
    }
    if (out.snapshot.size() > 500) out.snapshot.erase(out.snapshot.begin(), out.snapshot.end() - 500);
  }
  return out;
}

void Hub::unsubscribe(HubListener& listener, Topic topic) {
  auto bus = bus_.lock();
  auto& listeners = bus->of(topic).listeners;
  const auto it = listeners.find(&listener);
  if (it != listeners.end() && --it->second == 0) listeners.erase(it);
}

void Hub::tick() {
  auto bus = bus_.lock();
  const UtcTime now = clock_.now();
  for (const auto& topic : topics()) {
    auto& channel = bus->of(topic.topic);
    if (!channel.collected.empty())
      send(*bus, topic.topic, std::exchange(channel.collected, {}), channel.collected_t_us);
    if (topic.cls == TopicClass::stream) trim(topic, channel);
  }
  // A clock that was set back must not silence the heartbeat.
  const std::int64_t since_us = now.us() - bus->last_heartbeat_us;
  const bool heartbeat = since_us >= k_heartbeat_us || since_us < 0;
  if (heartbeat) bus->last_heartbeat_us = now.us();
  for (auto* listener : bus->connections) listener->on_tick(now, heartbeat);
}

void Hub::shut_down() {
  auto bus = bus_.lock();
  bus->closed = true;
  for (auto* listener : bus->connections) listener->on_bye(k_bye_code, k_bye_reason);
}

std::size_t Hub::clients() const {
  const auto bus = bus_.lock();
  return bus->connections.size();
}

}  // namespace anchord::api
