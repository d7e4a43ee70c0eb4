#include "api/webhooks/webhook_service.hpp"

#include <algorithm>

#include "api/webhooks/cloud_event.hpp"
#include "core/base/text.hpp"
#include "core/ports/web_post.hpp"
#include "core/ports/webhook_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_fresh = 1000;
constexpr std::int64_t k_second_ns = 1'000'000'000;
constexpr std::int64_t k_store_pause_ns = 5 * k_second_ns;  ///< where the database takes nothing
constexpr std::int64_t k_idle_ns = 3600 * k_second_ns;
constexpr std::int64_t k_live_ns = k_second_ns;  ///< from one live location to the next
constexpr int k_most_doublings = 6;              ///< of that, while a hub takes none: 64 s

bool takes_locations(const Webhook& webhook) {
  return webhook.kind == WebhookKind::omlox_hub &&
         std::ranges::find(webhook.events, k_location_event) != webhook.events.end();
}

}  // namespace

void WebhookService::changed() {
  const std::lock_guard only(starting_);
  if (deps_.post == nullptr) return;
  auto all = deps_.store.webhooks();
  {
    auto state = state_.lock();
    if (state->stopped) return;
    if (all) {
      state->enabled = std::move(all).value();
      std::erase_if(state->enabled, [](const Webhook& w) { return !w.enabled; });
    }
    ++state->news;
  }
  wake_.notify_all();
  begin_threads();
}

void WebhookService::begin_threads() {
  bool begin = false;
  std::set<WebhookId> missing, sending;
  {
    auto state = state_.lock();
    begin = !state->enabled.empty() && !state->running;
    if (begin) state->running = true;
    for (const auto& one : state->enabled) {
      if (state->sending.insert(one.id).second) missing.insert(one.id);
    }
    sending = state->sending;
  }
  if (begin) {
    if (thread_.joinable()) thread_.join();  // it ended by itself, when there was nobody to notify
    thread_ = Thread("anchord-hook", [this] { run(); });
  }
  // Those that are not among the sending have ended by themselves.
  std::erase_if(lanes_, [&](auto& one) {
    if (sending.contains(one.first) && !missing.contains(one.first)) return false;
    one.second->thread.join();
    return true;
  });
  for (const auto& id : missing) {
    const auto& lane = lanes_.emplace(id, std::make_unique<Lane>()).first->second;
    lane->thread = Thread("anchord-send", [this, id, &own = *lane] { run_lane(id, own); });
  }
}

void WebhookService::stop() {
  const std::lock_guard only(starting_);
  {
    auto state = state_.lock();
    state->stopped = true;
  }
  if (deps_.post != nullptr) deps_.post->stop();
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
  for (const auto& [id, lane] : lanes_) lane->thread.join();
  (void)guarded("locations not sent yet", [this] { keep_unsent(); });
  lanes_.clear();
  std::vector<WebhookDelivery> left;
  {
    auto state = state_.lock();
    left.assign(state->fresh.begin(), state->fresh.end());
    state->fresh.clear();
  }
  if (!left.empty()) (void)deps_.store.add(left).has_value();
}

bool WebhookService::ended() {
  auto state = state_.lock();
  if (!state->stopped && !state->enabled.empty()) return false;
  state->running = false;
  return true;
}

std::optional<WebhookService::Turn> WebhookService::turn_of(const WebhookId& id) {
  auto state = state_.lock();
  const auto at = std::ranges::find(state->enabled, id, &Webhook::id);
  if (!state->stopped && at != state->enabled.end()) return Turn{*at, state->news};
  state->sending.erase(id);
  return std::nullopt;
}

WebhookDelivery WebhookService::delivery(const Webhook& webhook, const LiveEvent& event) const {
  WebhookDelivery out;
  out.id.uuid = make_uuid_v7(event.time);
  out.webhook = webhook.id;
  out.event = event.code;
  out.body = {cloud_event(event)};
  out.created = event.time;
  out.due_ran_ns = deps_.running_ns();
  return out;
}

void WebhookService::notify(const LiveEvent& event) {
  if (std::ranges::find(k_webhook_events, event.code) == k_webhook_events.end()) return;
  {
    auto state = state_.lock();
    for (const auto& webhook : state->enabled) {
      if (std::ranges::find(webhook.events, event.code) == webhook.events.end()) continue;
      if (state->fresh.size() >= k_most_fresh) {
        ++state->dropped;
        continue;
      }
      state->fresh.push_back(delivery(webhook, event));
    }
    if (state->fresh.empty()) return;
  }
  wake_.notify_all();
}

Result<WebhookDelivery> WebhookService::test(const Webhook& webhook) {
  const UtcTime now = deps_.clock.now();
  const auto made = delivery(webhook, {make_uuid_v7(now), now, EventLevel::info, std::string(k_test_event),
                                       "test of webhook " + webhook.name, std::nullopt});
  BOOST_OUTCOME_TRY(deps_.store.add({made}));
  {
    auto state = state_.lock();
    ++state->news;
  }
  wake_.notify_all();
  return made;
}

void WebhookService::run() {
  while (!ended()) {
    bool all = false;
    (void)guarded("events to the outbox", [&] { all = store_fresh(); });
    auto state = state_.lock();
    state.wait_for(wake_, std::chrono::nanoseconds(all ? k_idle_ns : k_store_pause_ns), [&](const State& s) {
      return s.stopped || s.enabled.empty() || (all && !s.fresh.empty());
    });
  }
}

bool WebhookService::store_fresh() {
  std::vector<WebhookDelivery> fresh;
  {
    const auto state = state_.lock();
    fresh.assign(state->fresh.begin(), state->fresh.end());
  }
  if (fresh.empty()) return true;
  if (!deps_.store.add(fresh)) return false;  // they wait; new ones beyond the bound are counted
  {
    auto state = state_.lock();
    state->fresh.erase(state->fresh.begin(),
                       state->fresh.begin() + static_cast<std::ptrdiff_t>(fresh.size()));
    ++state->news;
  }
  wake_.notify_all();
  return true;
}

void WebhookService::run_lane(const WebhookId& id, Lane& lane) {
  while (const auto turn = turn_of(id)) {
    std::int64_t wait_ns = k_store_pause_ns;
    (void)guarded("webhooks", [&] { wait_ns = round(turn->webhook, lane.hub); });
    (void)guarded("locations to hubs",
                  [&] { wait_ns = std::min(wait_ns, live_round(turn->webhook, lane.hub)); });
    auto state = state_.lock();
    state.wait_for(wake_, std::chrono::nanoseconds(wait_ns),
                   [&](const State& s) { return s.stopped || s.news != turn->news; });
  }
}

std::int64_t WebhookService::round(const Webhook& webhook, Hub& known) {
  const auto pending = deps_.store.pending(webhook.id, 16);
  if (!pending) return k_store_pause_ns;
  for (const auto& one : pending.value()) {
    const auto now_ns = deps_.running_ns();
    if (one.due_ran_ns > now_ns) return std::min(one.due_ran_ns - now_ns, k_idle_ns);
    if (stopped()) return 0;
    attempt(webhook, known, one);
  }
  return pending.value().empty() ? k_idle_ns : 0;
}

WebhookService::Tried WebhookService::send_event(const Webhook& webhook, const WebhookDelivery& one,
                                                 UtcTime now) {
  const std::int64_t seconds = now.us() / 1'000'000;
  const std::string id = to_string(one.id);
  const auto answer = deps_.post->post(
      {webhook.url,
       {{"Content-Type", "application/cloudevents+json; charset=utf-8"},
        {"User-Agent", "anchord"},
        {"webhook-id", id},
        {"webhook-timestamp", std::to_string(seconds)},
        {"webhook-signature", webhook_signature(webhook.secret, id, seconds, one.body.text)}},
       one.body.text});
  if (!answer)
    return {std::nullopt, to_utf8(answer.error().message, 300), answer.error().code == Errc::canceled};
  if (answer.value() / 100 == 2) return {answer.value(), "", false};
  return {answer.value(),
          "answered " + std::to_string(answer.value()) +
              (answer.value() / 100 == 3 ? "; redirects are not followed" : ""),
          false};
}

WebhookService::Tried WebhookService::tried(const Result<HubSender::Sent>& sent) {
  if (!sent) return {std::nullopt, to_utf8(sent.error().message, 300), sent.error().code == Errc::canceled};
  return {sent.value().status, to_utf8(sent.value().fault, 300), false};
}

/// What is published, or where the tag is, is read when it is sent: a hub that was away gets what holds now.
WebhookService::Tried WebhookService::send_to_hub(const Webhook& hub, Hub& known,
                                                  const WebhookDelivery& one) {
  if (deps_.hubs == nullptr) return {std::nullopt, "this server sends to no hub", false};
  if (one.event != k_location_event) return tried(deps_.hubs->send_zones(hub));
  auto body = deps_.hubs->newest_locations();
  if (body.empty()) body = one.body.text;  // of before a restart
  auto result = tried(deps_.hubs->send_locations(hub, body));
  if (result.fault.empty()) known = {body, "", 0, 0, hub.version};
  return result;
}

void WebhookService::attempt(const Webhook& webhook, Hub& known, WebhookDelivery one) {
  const UtcTime now = deps_.clock.now();
  const bool hub = webhook.kind == WebhookKind::omlox_hub;
  auto result = hub ? send_to_hub(webhook, known, one) : send_event(webhook, one, now);
  if (result.canceled) return;  // not tried: it is due after the next start
  ++one.attempts;
  one.tried = now;
  one.status = result.status;
  one.fault = std::move(result.fault);
  if (one.fault.empty()) {
    one.state = DeliveryState::delivered;
  } else {
    const auto done = static_cast<std::size_t>(one.attempts);
    // 410: the receiver wants no more of it (Standard Webhooks).
    if (done > deps_.waits_s.size() || (!hub && one.status == 410))
      one.state = DeliveryState::failed;
    else
      one.due_ran_ns = deps_.running_ns() + static_cast<std::int64_t>(deps_.waits_s[done - 1] * 1e9);
  }
  // Where the database takes it not, it is sent again: at least once.
  (void)deps_.store.record(one).has_value();
}

std::int64_t WebhookService::live_round(const Webhook& hub, Hub& known) {
  if (deps_.hubs == nullptr || !takes_locations(hub)) return k_idle_ns;
  if (known.version != hub.version) known = {"", "", 0, 0, hub.version};  // perhaps another address
  const auto body = deps_.hubs->newest_locations();
  if (body.empty() || body == known.sent) return k_live_ns;
  const auto now_ns = deps_.running_ns();
  if (known.due_ns > now_ns) return std::min(k_live_ns, known.due_ns - now_ns);
  if (!stopped()) send_live(hub, known, body);
  return k_live_ns;
}

void WebhookService::send_live(const Webhook& hub, Hub& known, const std::string& body) {
  auto result = tried(deps_.hubs->send_locations(hub, body));
  if (result.canceled) return;
  {
    auto state = state_.lock();
    auto& live = state->live[hub.id];
    if (result.fault.empty()) ++live.taken;
    live.tried = deps_.clock.now();
    live.status = result.status;
    live.fault = result.fault;
  }
  if (result.fault.empty()) {
    known.sent = body;
    known.failures = 0;
    return;
  }
  if (known.failures == 0) keep(hub, known, body, result);
  known.failures = std::min(known.failures + 1, k_most_doublings);
  known.due_ns = deps_.running_ns() + (k_live_ns << known.failures);
}

void WebhookService::keep(const Webhook& hub, Hub& known, const std::string& body, const Tried& why) {
  WebhookDelivery one;
  one.created = deps_.clock.now();
  one.id.uuid = make_uuid_v7(one.created);
  one.webhook = hub.id;
  one.event = std::string(k_location_event);
  one.body = {body};
  one.attempts = 1;
  one.tried = one.created;
  one.status = why.status;
  one.fault = why.fault;
  const double wait_s = deps_.waits_s.empty() ? 0 : deps_.waits_s.front();
  one.due_ran_ns = deps_.running_ns() + static_cast<std::int64_t>(wait_s * 1e9);
  if (!deps_.store.add({one})) return;  // the next failure in a row is not kept; the newest is, at the stop
  (void)deps_.store.record(one).has_value();
  known.kept = body;
}

/// The newest goes behind what was kept of it at the first failure, and so holds in the end.
void WebhookService::keep_unsent() {
  if (deps_.hubs == nullptr) return;
  const auto body = deps_.hubs->newest_locations();
  if (body.empty()) return;
  std::vector<Webhook> enabled;
  {
    const auto state = state_.lock();
    enabled = state->enabled;
  }
  for (const auto& hub : enabled) {
    const auto lane = lanes_.find(hub.id);
    if (!takes_locations(hub) || lane == lanes_.end()) continue;
    auto& known = lane->second->hub;
    if (body == known.sent || body == known.kept) continue;
    keep(hub, known, body, {std::nullopt, "the server stopped before it was sent", false});
  }
}

std::optional<HubLive> WebhookService::live(const WebhookId& hub) const {
  const auto state = state_.lock();
  const auto at = state->live.find(hub);
  if (at == state->live.end()) return std::nullopt;
  return at->second;
}

}  // namespace anchord::api
