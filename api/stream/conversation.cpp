#include "api/stream/conversation.hpp"

#include <array>
#include <chrono>
#include <nlohmann/json.hpp>

#include "api/kit/problem.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/router.hpp"
#include "api/stream/frames.hpp"
#include "api/stream/steady_us.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

constexpr std::array<std::string_view, 1> k_encodings{"json"};

/// What a subscription that begins anew is shown first.
std::string snap_of(const Subscription& subscription, const Resumed& start, bool keyed) {
  std::vector<LiveElement> wanted;
  for (const auto& element : start.snapshot) {
    if (subscription.wants(element)) wanted.push_back(subscription.seen(element));
  }
  return snap_frame(subscription.id, start.last_seq, start.t_us, wanted, keyed);
}

}  // namespace

Conversation::Conversation(Hub& hub, Principal principal, std::function<bool()> holds)
    : hub_(hub),
      principal_(std::move(principal)),
      holds_(std::move(holds)),
      output_(std::in_place, hub.counters()) {}

Conversation::~Conversation() = default;

void Conversation::on_open(std::function<void()> wake) {
  wake_ = std::move(wake);
  Json topic_names = Json::array(), roles = Json::array();
  for (const auto& topic : topics()) topic_names.push_back(topic.name);
  for (const Role role : principal_.roles) roles.push_back(to_string(role));
  nlohmann::ordered_json hello{{"op", "hello"},
                               {"server", hub_.server_name()},
                               {"epoch", hub_.epoch()},
                               {"t_us", hub_.clock().now().us()},
                               {"hb_ms", k_heartbeat_us / 1000},
                               {"topics", topic_names},
                               {"roles", roles}};
  send(to_wire(hello));
  membership_ = hub_.join(*this);
}

void Conversation::on_close() { membership_ = {}; }

void Conversation::on_text(std::string_view text) {
  Json message;
  if (text.size() > 64 * 1024) return close(4009, "protocol");
  if (parse_json(text, message) || !message.is_object() || !message.contains("op") ||
      !message["op"].is_string()) {
    refuse(message, 400, "malformed", "send JSON objects with an op");
    return close(4009, "protocol");
  }
  const auto& op = message["op"].get_ref<const std::string&>();
  if (op == "sub") return subscribe(message);
  if (op == "unsub") return unsubscribe(message);
  if (op == "seen") return seen(message);
  if (op == "time") {
    nlohmann::ordered_json answer{{"op", "time"},
                                  {"id", message.value("id", Json())},
                                  {"c_us", message.value("c_us", Json())},
                                  {"t_us", hub_.clock().now().us()}};
    return send(to_wire(answer));
  }
  refuse(message, 422, "validation", "op must be sub, unsub, seen or time");
}

void Conversation::subscribe(const Json& message) {
  std::vector<FieldError> errors;
  Fields fields(message, "", errors);
  fields.child("op");
  const auto id = fields.integer("id", 0, INT64_MAX);
  const auto name = fields.text("topic", 64, true);
  Subscription subscription;
  if (const Json* params = fields.child("params")) {
    Fields inner(*params, "/params", errors);
    if (const auto hz = inner.number("max_hz", 0.01, 1000))
      subscription.min_interval_us = static_cast<std::int64_t>(1e6 / *hz);
    if (const auto age_s = inner.number("max_age_s", 0.1, 60))
      subscription.max_age_us = static_cast<std::int64_t>(1e6 * *age_s);
    subscription.deltas = inner.boolean("deltas").value_or(false);
    if (subscription.deltas && name != "anchors.estimates")
      inner.error("deltas", "not_applicable", "only the topic anchors.estimates has deltas");
    if (const Json* anchors = inner.child("anchors")) {
      if (!anchors->is_array() || anchors->size() > 1000)
        inner.error("anchors", "wrong_type", "must be an array of at most 1000 network ids");
      else
        for (const auto& item : *anchors) {
          const auto anchor = parse_network_id(item.is_string() ? item.get_ref<const std::string&>() : "");
          if (anchor)
            subscription.anchors.insert(anchor.value());
          else
            inner.error("anchors", "bad_id", anchor.error().message);
        }
    }
    inner.word("encoding", k_encodings);
    inner.finish();
  }
  std::optional<std::pair<std::string, std::uint64_t>> since;
  if (const Json* from = fields.child("since")) {
    Fields inner(*from, "/since", errors);
    const auto epoch = inner.text("epoch", 64, true);
    const auto seq = inner.integer("seq", 0, INT64_MAX, true);
    inner.finish();
    if (epoch && seq) since = {*epoch, static_cast<std::uint64_t>(*seq)};
  }
  fields.finish();
  if (!errors.empty())
    return refuse(message, 422, "validation", errors.front().pointer + ": " + errors.front().detail);
  const TopicInfo* topic = find_topic(*name);
  if (topic == nullptr) return refuse(message, 404, "not-found", "there is no topic " + *name);
  if (subscriptions_.size() >= k_max_subscriptions) {
    refuse(message, 429, "rate-limited", "a connection can have at most 32 subscriptions");
    return;
  }
  subscription.topic = topic->topic;
  subscription.sites = principal_.sites;
  subscription.id = default_sub(topic->topic);
  // The usual number lets all clients share the bytes of a frame; a second subscription of the topic gets its
  // own.
  if (subscriptions_.count(subscription.id) > 0) subscription.id = next_sub_++;
  subscriptions_[subscription.id] = topic->topic;

  {
    // Before the hub knows of it, so that nothing published meanwhile is lost; where it begins is known
    // after.
    auto output = output_.lock();
    output->outbox.add(subscription);
  }
  const Resumed start = membership_.subscribe(topic->topic, since);
  nlohmann::ordered_json ack{{"op", "ack"},
                             {"id", id ? Json(*id) : Json()},
                             {"sub", subscription.id},
                             {"from_seq", start.recovered ? since->second + 1 : start.last_seq + 1},
                             {"recovered", start.recovered}};
  std::string frames = to_wire(ack), snap;
  if (!start.recovered) snap = snap_of(subscription, start, topic->keyed);
  {
    auto output = output_.lock();
    bool room = output->outbox.control(std::move(frames));
    output->outbox.start(subscription.id, start.recovered ? since->second : start.last_seq, start.missed,
                         start.snapshot);
    if (!start.recovered) room = output->outbox.control(std::move(snap)) && room;
    if (!room) output->close = {4008, "slow_consumer"};
  }
  if (wake_) wake_();
}

void Conversation::unsubscribe(const Json& message) {
  std::vector<FieldError> errors;
  Fields fields(message, "", errors);
  fields.child("op");
  const auto id = fields.integer("id", 0, INT64_MAX);
  const auto sub = fields.integer("sub", 0, INT64_MAX, true);
  fields.finish();
  if (!errors.empty())
    return refuse(message, 422, "validation", errors.front().pointer + ": " + errors.front().detail);
  const auto it = subscriptions_.find(static_cast<std::uint64_t>(*sub));
  if (it == subscriptions_.end()) return refuse(message, 404, "not-found", "there is no such subscription");
  membership_.unsubscribe(it->second);
  {
    auto output = output_.lock();
    output->outbox.remove(it->first);
  }
  nlohmann::ordered_json ack{{"op", "ack"}, {"id", id ? Json(*id) : Json()}, {"sub", it->first}};
  subscriptions_.erase(it);
  send(to_wire(ack));
}

/// Without an answer: it comes twenty times a second.
void Conversation::seen(const Json& message) {
  std::vector<FieldError> errors;
  Fields fields(message, "", errors);
  fields.child("op");
  const auto frames = fields.integer("frames", 0, INT64_MAX, true);
  fields.finish();
  if (!errors.empty())
    return refuse(message, 422, "validation", errors.front().pointer + ": " + errors.front().detail);
  bool sent = true;
  {
    auto output = output_.lock();
    sent = output->outbox.seen(static_cast<std::uint64_t>(*frames), steady_us());
  }
  if (!sent) refuse(message, 422, "validation", "/frames: more than this connection was sent");
}

void Conversation::refuse(const Json& message, int status, std::string_view type, std::string_view detail) {
  const Json id = message.is_object() && message.contains("id") && message["id"].is_number_integer()
                      ? message["id"]
                      : Json();
  send(R"({"op":"err","id":)" + to_wire(id) + R"(,"problem":)" + problem_json(status, type, detail) + '}');
}

void Conversation::send(std::string frame) {
  {
    auto output = output_.lock();
    if (!output->outbox.control(std::move(frame)) && !output->close) output->close = {4008, "slow_consumer"};
  }
  if (wake_) wake_();
}

void Conversation::close(std::uint16_t code, std::string_view reason) {
  {
    auto output = output_.lock();
    if (output->close) return;
    if (code == 4008) ++hub_.counters().slow_disconnects;
    output->outbox.control(bye_frame(code, reason));
    output->close = {code, std::string(reason)};
  }
  if (wake_) wake_();
}

void Conversation::on_message(Topic topic, const std::shared_ptr<const LiveMessage>& message) {
  bool due = false, room = true;
  {
    auto output = output_.lock();
    if (output->close) return;
    room = output->outbox.put(message, topic, steady_us());
    due = output->outbox.due(steady_us());
  }
  if (!room)
    close(4008, "slow_consumer");
  else if (due && wake_)
    wake_();
}

void Conversation::on_tick(UtcTime now, bool heartbeat) {
  // Four times a second: a login that was revoked sees nothing more after a moment.
  if (ticks_++ % 5 == 0 && holds_ && !holds_()) return close(4001, "auth");
  bool due = false;
  {
    auto output = output_.lock();
    if (output->close) return;
    if (heartbeat) output->outbox.heartbeat(now.us());
    due = output->outbox.due(steady_us());
  }
  if (due && wake_) wake_();
}

void Conversation::on_bye(std::uint16_t code, std::string_view reason) { close(code, reason); }

std::shared_ptr<const std::string> Conversation::next_frame() {
  auto output = output_.lock();
  // After a close was asked for only control frames (the bye among them) still go out.
  if (output->close) return output->outbox.next_control();
  return output->outbox.next(steady_us());
}

std::optional<std::pair<std::uint16_t, std::string>> Conversation::close_request() {
  const auto output = output_.lock();
  return output->close;
}

}  // namespace anchord::api
