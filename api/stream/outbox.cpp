#include "api/stream/outbox.hpp"

#include <algorithm>
#include <array>

#include "api/stream/delta.hpp"
#include "api/stream/frames.hpp"

namespace anchord::api {
namespace {

/// By these a client knows what a difference is of.
constexpr std::array<std::string_view, 2> k_identity{"mission", "anchor"};
/// A client that asked for less is not slow before its frame is overdue by this.
constexpr std::int64_t k_grace_us = 200'000;

}  // namespace

void Outbox::add(const Subscription& subscription) { queues_[subscription.id].subscription = subscription; }

void Outbox::remove(std::uint64_t sub) {
  const auto it = queues_.find(sub);
  if (it == queues_.end()) return;
  for (const auto& waiting : it->second.messages) {
    bytes_ -= waiting.message->bytes();
    --count_;
  }
  queues_.erase(it);
}

void Outbox::start(std::uint64_t sub, std::uint64_t last_seq,
                   const std::vector<std::shared_ptr<const LiveMessage>>& missed,
                   const std::vector<LiveElement>& snapshot) {
  auto& queue = queues_[sub];
  queue.subscription.last_seq = last_seq;
  queue.started = true;
  if (queue.subscription.deltas) {
    for (const auto& element : snapshot)
      if (queue.subscription.wants(element)) queue.shown[element.key] = queue.subscription.seen(element).json;
  }
  for (const auto& message : missed) {
    const auto& elements = message->elements;
    if (std::any_of(elements.begin(), elements.end(),
                    [&](const auto& e) { return queue.subscription.wants(e); }))
      queue.replay.push_back({message, INT64_MAX / 2});
  }
}

void Outbox::heartbeat(std::int64_t t_us) {
  heartbeat_ = heartbeat_frame(t_us, fill(), conflated_since_heartbeat_);
  conflated_since_heartbeat_ = false;
}

bool Outbox::control(std::string frame) {
  bytes_ += frame.size();
  ++count_;
  control_.push_back(std::move(frame));
  while ((bytes_ > k_max_bytes || count_ > k_max_messages)) {
    const std::size_t before = count_;
    drop_oldest_stream();
    if (count_ == before) break;
  }
  // A snap alone may be large; only a client that piles up control frames is too slow.
  return control_.size() <= k_max_messages;
}

bool Outbox::put(const std::shared_ptr<const LiveMessage>& message, Topic topic, std::int64_t now_us) {
  const TopicClass cls = info(topic).cls;
  for (auto& [id, queue] : queues_) {
    if (queue.subscription.topic != topic) continue;
    const auto& elements = message->elements;
    const bool any = std::any_of(elements.begin(), elements.end(),
                                 [&](const auto& e) { return queue.subscription.wants(e); });
    if (!any) continue;
    if (cls == TopicClass::state) {
      queue.only = queue.newest.empty() && queue.subscription.sites.all() ? message : nullptr;
      for (const auto& element : elements) {
        if (!queue.subscription.wants(element)) {
          queue.only = nullptr;
          continue;
        }
        auto& pending = queue.newest[element.key];
        if (pending.element.json) {
          ++queue.conflated;
          ++counters_.conflated;
          const bool asked_for_less = queue.subscription.min_interval_us > 0 || queue.subscription.deltas;
          conflated_since_heartbeat_ |= !asked_for_less || now_us - queue.due_us > k_grace_us;
        }
        pending = {queue.subscription.seen(element), message->seq, message->t_us};
      }
      continue;
    }
    bytes_ += message->bytes();
    ++count_;
    queue.messages.push_back({message, now_us});
    if (cls == TopicClass::stream) drop_aged(queue, now_us);
    while (bytes_ > k_max_bytes || count_ > k_max_messages) {
      const std::size_t before = count_;
      drop_oldest_stream();
      if (count_ == before) {
        if (cls == TopicClass::event) return false;
        break;
      }
    }
  }
  return true;
}

void Outbox::drop_oldest_stream() {
  Queue* oldest = nullptr;
  for (auto& [id, queue] : queues_) {
    if (info(queue.subscription.topic).cls != TopicClass::stream || queue.messages.empty()) continue;
    if (oldest == nullptr || queue.messages.front().message->t_us < oldest->messages.front().message->t_us)
      oldest = &queue;
  }
  if (oldest != nullptr) drop_front(*oldest);
}

void Outbox::drop_front(Queue& queue) {
  const auto& message = queue.messages.front().message;
  if (queue.gap_dropped == 0) queue.gap_from = message->seq;
  queue.gap_to = message->seq;
  ++queue.gap_dropped;
  ++counters_.dropped;
  bytes_ -= message->bytes();
  --count_;
  queue.messages.pop_front();
}

/// Less, and never older.
void Outbox::drop_aged(Queue& queue, std::int64_t now_us) {
  const auto longest_us = queue.subscription.max_age_us;
  while (longest_us > 0 && !queue.messages.empty() && now_us - queue.messages.front().since_us > longest_us) {
    drop_front(queue);
    conflated_since_heartbeat_ = true;
  }
}

bool Outbox::ready(const Queue& queue, std::int64_t now_us) const {
  if (queue.newest.empty() && queue.messages.empty() && queue.replay.empty() && queue.gap_dropped == 0)
    return false;
  return queue.started && (now_us >= queue.due_us || now_us < queue.sent_us);
}

bool Outbox::due(std::int64_t now_us) const {
  if (!control_.empty() || !heartbeat_.empty()) return true;
  return unseen_.open(now_us) && std::any_of(queues_.begin(), queues_.end(),
                                             [&](const auto& entry) { return ready(entry.second, now_us); });
}

std::shared_ptr<const std::string> Outbox::next_control() {
  if (control_.empty()) return nullptr;
  auto frame = std::make_shared<const std::string>(std::move(control_.front()));
  control_.pop_front();
  bytes_ -= frame->size();
  --count_;
  return frame;
}

std::shared_ptr<const std::string> Outbox::next(std::int64_t now_us) {
  auto frame = pick(now_us);
  if (frame) unseen_.sent(now_us);
  return frame;
}

/// Answers and heartbeats always; what is news, while the client keeps up.
std::shared_ptr<const std::string> Outbox::pick(std::int64_t now_us) {
  if (auto frame = next_control()) return frame;
  if (!heartbeat_.empty()) return std::make_shared<const std::string>(std::exchange(heartbeat_, {}));
  return unseen_.open(now_us) ? pick_content(now_us) : nullptr;
}

/// The one that has waited longest since its last frame, so that no topic takes all that a slow client reads;
/// of equals state before events before streams.
Outbox::Queue* Outbox::next_queue(std::int64_t now_us) {
  Queue* next = nullptr;
  for (const TopicClass cls : {TopicClass::state, TopicClass::event, TopicClass::stream}) {
    for (auto& [id, queue] : queues_) {
      if (info(queue.subscription.topic).cls != cls || !ready(queue, now_us)) continue;
      if (next == nullptr || queue.sent_us < next->sent_us) next = &queue;
    }
  }
  return next;
}

std::shared_ptr<const std::string> Outbox::pick_content(std::int64_t now_us) {
  Queue* const picked = next_queue(now_us);
  if (picked == nullptr) return nullptr;
  Queue& queue = *picked;
  const TopicClass cls = info(queue.subscription.topic).cls;
  queue.sent_us = now_us;
  queue.due_us = now_us + queue.subscription.min_interval_us;
  if (cls == TopicClass::state) {
    auto frame = take_state(queue);
    const auto bytes = static_cast<std::int64_t>(frame->size());
    if (queue.subscription.deltas)
      queue.due_us = std::max(queue.due_us, now_us + bytes * 1'000'000 / k_delta_bytes_per_s);
    return frame;
  }
  if (cls == TopicClass::stream) drop_aged(queue, now_us);
  if (!queue.replay.empty()) return take_messages(queue, queue.replay, true);
  if (queue.gap_dropped > 0) {
    auto frame = std::make_shared<const std::string>(
        gap_frame(queue.subscription.id, queue.gap_from, queue.gap_to, queue.gap_dropped));
    queue.subscription.last_seq = queue.gap_to;
    queue.gap_dropped = 0;
    queue.sent_us = queue.due_us = INT64_MIN / 2;
    return frame;
  }
  return take_messages(queue, queue.messages, cls == TopicClass::stream);
}

std::shared_ptr<const std::string> Outbox::take_state(Queue& queue) {
  auto& subscription = queue.subscription;
  std::vector<LiveElement> elements;
  std::uint64_t seq = 0;
  std::int64_t t_us = 0;
  for (auto& [key, pending] : queue.newest) {
    seq = std::max(seq, pending.seq);
    t_us = std::max(t_us, pending.t_us);
    // Asked again: the site may have left the client's organization while this waited.
    if (subscription.wants(pending.element)) elements.push_back(subscription.seen(pending.element));
  }
  if (subscription.deltas) {
    to_deltas(queue, elements);
    queue.only = nullptr;
  }
  std::shared_ptr<const std::string> frame;
  if (queue.only && queue.only->frame && queue.conflated == 0 &&
      subscription.id == default_sub(subscription.topic) && subscription.last_seq + 1 == seq) {
    frame = queue.only->frame;
  } else {
    frame = data_frame(subscription.id, seq, subscription.last_seq, t_us, elements, false, queue.conflated);
  }
  queue.newest.clear();
  queue.only = nullptr;
  queue.conflated = 0;
  subscription.last_seq = seq;
  return frame;
}

/// What the client has of a key is replaced by what it gets now; one it does not have is sent whole.
void Outbox::to_deltas(Queue& queue, std::vector<LiveElement>& elements) {
  for (auto& element : elements) {
    auto& shown = queue.shown[element.key];
    const Text whole = element.json;
    if (shown) element.json = std::make_shared<const std::string>(delta_of(*shown, *whole, k_identity));
    shown = whole;
  }
}

std::shared_ptr<const std::string> Outbox::take_messages(Queue& queue, std::deque<Waiting>& from,
                                                         bool merge) {
  const bool counted = &from == &queue.messages;
  auto& subscription = queue.subscription;
  const bool filtered = !subscription.anchors.empty() || !subscription.sites.all();
  std::vector<LiveElement> elements;
  std::shared_ptr<const LiveMessage> last;
  std::size_t taken = 0, size = 0;
  // What queued up while the client was busy leaves as one frame, of a size that is still one gulp.
  while (!from.empty() && (taken == 0 || (merge && size < 64 * 1024))) {
    last = std::move(from.front().message);
    from.pop_front();
    if (counted) {
      bytes_ -= last->bytes();
      --count_;
    }
    ++taken;
    size += last->bytes();
    for (const auto& element : last->elements) {
      if (subscription.wants(element)) elements.push_back(subscription.seen(element));
    }
  }
  std::shared_ptr<const std::string> frame;
  if (taken == 1 && !filtered && last->frame && subscription.id == default_sub(subscription.topic) &&
      subscription.last_seq + 1 == last->seq) {
    frame = last->frame;
  } else {
    frame = data_frame(subscription.id, last->seq, subscription.last_seq, last->t_us, elements, merge, 0);
  }
  subscription.last_seq = last->seq;
  return frame;
}

double Outbox::fill() const {
  return std::max(static_cast<double>(bytes_) / static_cast<double>(k_max_bytes),
                  static_cast<double>(count_) / static_cast<double>(k_max_messages));
}

}  // namespace anchord::api
