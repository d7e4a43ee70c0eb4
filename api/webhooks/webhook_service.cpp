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

}  // namespace

void WebhookService::changed() {
  const std::lock_guard only(starting_);
  if (deps_.post == nullptr) return;
  auto all = deps_.store.webhooks();
  bool begin = false;
  {
    auto state = state_.lock();
    if (state->stopped) return;
    if (all) {
      state->enabled = std::move(all).value();
      std::erase_if(state->enabled, [](const Webhook& w) { return !w.enabled; });
    }
    state->look = true;
    begin = !state->enabled.empty() && !state->running;
    if (begin) state->running = true;
  }
  wake_.notify_all();
  if (!begin) return;
  if (thread_.joinable()) thread_.join();  // it ended by itself, when there was nobody to notify
  thread_ = Thread("anchord-hook", [this] { run(); });
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
    state->look = true;
  }
  wake_.notify_all();
  return made;
}

void WebhookService::run() {
  while (!ended()) {
    std::int64_t wait_ns = k_store_pause_ns;
    (void)guarded("webhooks", [&] { wait_ns = round(); });
    auto state = state_.lock();
    state.wait_for(wake_, std::chrono::nanoseconds(wait_ns), [&](const State& s) {
      return s.stopped || s.look || (!s.fresh.empty() && wait_ns != k_store_pause_ns);
    });
  }
}

std::int64_t WebhookService::round() {
  std::vector<WebhookDelivery> fresh;
  std::vector<Webhook> enabled;
  {
    auto state = state_.lock();
    state->look = false;
    enabled = state->enabled;
    fresh.assign(state->fresh.begin(), state->fresh.end());
  }
  if (!fresh.empty()) {
    if (!deps_.store.add(fresh)) return k_store_pause_ns;  // they wait; new ones beyond the bound are counted
    auto state = state_.lock();
    state->fresh.erase(state->fresh.begin(),
                       state->fresh.begin() + static_cast<std::ptrdiff_t>(fresh.size()));
  }
  const auto pending = deps_.store.pending(16);
  if (!pending) return k_store_pause_ns;
  for (const auto& one : pending.value()) {
    const auto now_ns = deps_.running_ns();
    if (one.due_ran_ns > now_ns) return std::min(one.due_ran_ns - now_ns, k_idle_ns);
    if (stopped()) return 0;
    const auto to = std::ranges::find(enabled, one.webhook, &Webhook::id);
    if (to == enabled.end()) return k_second_ns;  // it was added this moment: changed() is on its way
    attempt(*to, one);
  }
  return pending.value().empty() ? k_idle_ns : 0;
}

void WebhookService::attempt(const Webhook& webhook, WebhookDelivery one) {
  const UtcTime now = deps_.clock.now();
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
  if (!answer && answer.error().code == Errc::canceled) return;  // not tried: it is due after the next start
  ++one.attempts;
  one.tried = now;
  one.status = answer ? std::optional(answer.value()) : std::nullopt;
  one.fault.clear();
  if (answer && answer.value() / 100 == 2) {
    one.state = DeliveryState::delivered;
  } else {
    one.fault = answer ? "answered " + std::to_string(answer.value()) +
                             (answer.value() / 100 == 3 ? "; redirects are not followed" : "")
                       : to_utf8(answer.error().message, 300);
    const auto done = static_cast<std::size_t>(one.attempts);
    // 410: the receiver wants no more of it (Standard Webhooks).
    if (done > deps_.waits_s.size() || (answer && answer.value() == 410))
      one.state = DeliveryState::failed;
    else
      one.due_ran_ns = deps_.running_ns() + static_cast<std::int64_t>(deps_.waits_s[done - 1] * 1e9);
  }
  // Where the database takes it not, it is sent again: at least once.
  (void)deps_.store.record(one).has_value();
}

}  // namespace anchord::api
