#include "api/admin/flight_events.hpp"

#include <algorithm>
#include <chrono>

#include "api/kit/late_writer.hpp"
#include "core/base/retry.hpp"
#include "core/ports/event_store.hpp"

namespace anchord::api {
namespace {

constexpr std::chrono::milliseconds k_patience{1000};  // of a reader, for what is being written

constexpr std::size_t k_events_a_write = 100;  // while a write waits, the next is asked for after so many

bool is_among(const std::vector<LiveEvent>& events, const LiveEvent& one) {
  return std::ranges::find(events, one.id, &LiveEvent::id) != events.end();
}

}  // namespace

void FlightEvents::keep(const LiveEvent& event) {
  if (!event.mission) return;
  bool due = false;
  {
    auto waiting = waiting_.lock();
    if (waiting->size() >= k_max_waiting) waiting->erase(waiting->begin());
    waiting->push_back(event);
    due = waiting->size() % k_events_a_write == 1;
  }
  if (due) writer_.write([this] { return store_waiting(); }, {});
}

std::vector<LiveEvent> FlightEvents::waiting() const {
  const auto waiting = waiting_.lock();
  return *waiting;
}

Result<void> FlightEvents::store_waiting() {
  const auto batch = waiting();
  if (batch.empty()) return boost::outcome_v2::success();
  const auto stored = store_.append(batch);
  // What the store refuses for good will not be taken later either; what may pass is tried again.
  if (!stored && may_pass(stored.error().code)) return stored;
  bool more = false;
  {
    auto waiting = waiting_.lock();
    std::erase_if(*waiting, [&](const LiveEvent& one) { return is_among(batch, one); });
    more = !waiting->empty();
  }
  if (more) writer_.write([this] { return store_waiting(); }, {});
  return stored;
}

Result<std::vector<LiveEvent>> FlightEvents::newest(const MissionId& mission, std::size_t limit,
                                                    std::optional<UtcTime> since,
                                                    const std::optional<EventId>& after) const {
  if (after) return store_.events(mission, limit, since, after);
  if (!waiting().empty()) writer_.flush(k_patience);
  auto out = waiting();  // before the store is read: else one could be in neither
  std::erase_if(out,
                [&](const LiveEvent& one) { return one.mission != mission || (since && one.time < *since); });
  std::ranges::reverse(out);
  BOOST_OUTCOME_TRY(auto stored, store_.events(mission, limit, since, {}));
  std::erase_if(out, [&](const LiveEvent& one) { return is_among(stored, one); });
  out.insert(out.end(), std::make_move_iterator(stored.begin()), std::make_move_iterator(stored.end()));
  if (out.size() > limit) out.resize(limit);
  return out;
}

Result<std::vector<LiveEvent>> FlightEvents::all(const MissionId& mission, std::size_t most) const {
  BOOST_OUTCOME_TRY(auto events, newest(mission, most));
  std::ranges::reverse(events);
  return events;
}

}  // namespace anchord::api
