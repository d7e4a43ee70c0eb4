#include "api/admin/event_log.hpp"
#include "api/missions/mission_service_state.hpp"
#include "api/stream/hub.hpp"
#include "core/base/guard.hpp"

namespace anchord::api {

namespace {

constexpr std::size_t k_slice = 500;      // rows; other missions share the pool
constexpr std::size_t k_announced = 100;  // rows between two announcements of estimates

}  // namespace

flight::LiveRow MissionService::State::row_of(Range range) const {
  flight::JudgedRange row{std::move(range), {}, {}};
  row.time = row.range.time;
  row.model = deps.judge(row.range);
  row.range.cir.reset();  // a queued row needs none, and it is 4 kB
  return row;
}

template <class R>
void MissionService::State::enqueue(Flight& flight, const R& row, SteadyTime now) {
  flight::LiveRow judged = row_of(row);
  const std::scoped_lock lock(flight.queue_mutex);
  if (flight.gone) return;
  flight.last_arrival = flight.used = now;
  (std::is_same_v<R, Fix> ? flight.fix_arrival : flight.range_arrival) = now;
  if (flight.queue.size() >= k_max_queued_rows) {
    flight.queue.pop_front();
    ++flight.dropped;
    --queued;
  }
  flight.queue.push_back(std::move(judged));
  flight.closing = flight.mission.state == MissionState::finished;
  ++queued;
}

template <class R>
void MissionService::State::take_newest(std::span<const R> rows) {
  const SteadyTime now = steady_now();
  std::shared_ptr<Flight> flight;
  for (const auto& row : rows) {
    if (!flight || flight->id != row.mission) flight = find(row.mission);
    if (!flight) continue;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      // While it is read back from the store its newest row is not known.
      if (flight->rebuilding || !flight->ahead.take(row)) continue;
    }
    enqueue(*flight, row, now);
  }
  for (const auto& f : all()) schedule(f);
}

template <class R>
void MissionService::State::accept(std::span<const R> rows, std::span<const RowOutcome> outcomes) {
  const SteadyTime now = steady_now();
  std::shared_ptr<Flight> flight;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!flight || flight->id != rows[i].mission) flight = find(rows[i].mission);
    if (!flight) continue;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      // Of several senders of one row the store accepts one: whoever was live with it, it has been had.
      if (outcomes[i] != RowOutcome::accepted || flight->ahead.settle(rows[i])) continue;
    }
    enqueue(*flight, rows[i], now);
  }
  for (const auto& f : all()) schedule(f);
}

template void MissionService::State::take_newest(std::span<const Range>);
template void MissionService::State::take_newest(std::span<const Fix>);
template void MissionService::State::accept(std::span<const Range>, std::span<const RowOutcome>);
template void MissionService::State::accept(std::span<const Fix>, std::span<const RowOutcome>);

void MissionService::State::schedule(const std::shared_ptr<Flight>& flight) {
  {
    const std::scoped_lock lock(flight->queue_mutex);
    if (flight->scheduled || stopped || flight->rebuilding) return;
    if (flight->queue.empty() && !flight->closing && !flight->new_clues) return;
    flight->scheduled = true;
  }
  post(*flight->strand, [self = shared_from_this(), flight] {
    const auto ran = guarded("live path", [&] {
      if (!self->stopped) self->work(*flight);
    });
    bool again = false;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      flight->scheduled = false;
      // Its rows are stored; a close that throws would be tried for ever.
      if (!ran) flight->closing = false;
      again = !flight->queue.empty() || flight->closing || flight->new_clues;
    }
    if (again) self->schedule(flight);
  });
}

void MissionService::State::post(Executor& on, std::function<void()> task) {
  {
    const std::scoped_lock lock(running_mutex);
    ++running;
  }
  on.post([self = shared_from_this(), task = std::move(task)] {
    (void)guarded("live path", task);
    {
      const std::scoped_lock lock(self->running_mutex);
      --self->running;
    }
    self->idle.notify_all();
  });
}

void MissionService::State::work(Flight& flight) {
  std::deque<flight::LiveRow> rows;
  std::uint64_t dropped = 0;
  {
    const std::scoped_lock lock(flight.queue_mutex);
    const std::size_t n = std::min(flight.queue.size(), k_slice);
    for (std::size_t i = 0; i < n; ++i) {
      rows.push_back(std::move(flight.queue.front()));
      flight.queue.pop_front();
    }
    dropped = std::exchange(flight.dropped, 0);
  }
  queued -= rows.size();
  if (dropped > 0) {
    deps.events.add("warning", "live.behind",
                    std::to_string(dropped) + " measurements left the live path; they are stored", flight.id);
  }
  const std::scoped_lock lock(flight.work_mutex);
  if (flight.rebuilding) {
    // It begins anew: what was taken goes back to the head of the queue, and is worked off after what is
    // stored.
    const std::scoped_lock queue(flight.queue_mutex);
    queued += rows.size();
    for (auto it = rows.rbegin(); it != rows.rend(); ++it) flight.queue.push_front(std::move(*it));
    return;
  }
  take_clues(flight);
  std::size_t since_announced = 0;
  for (const auto& row : rows) {
    if (!flight.rebuilt.empty() && std::ranges::binary_search(flight.rebuilt, flight::identity(row)))
      continue;
    note_radios(row);
    flight.live.add(row);
    if (++since_announced == k_announced) {
      flight.live.settle();
      since_announced = 0;
    }
    tell_events(flight);
  }
  bool closing = false;
  {
    const std::scoped_lock queue(flight.queue_mutex);
    if (flight.queue.empty()) {
      flight.rebuilt = {};
      closing = std::exchange(flight.closing, false);
    }
  }
  if (closing) flight.live.finish();
  flight.live.settle();
  flight.live.show_pose();
  tell_events(flight);
  flight.dirty = true;
  bool view_wanted = false;
  {
    const std::scoped_lock queue(flight.queue_mutex);
    view_wanted = std::exchange(flight.view_wanted, false);
  }
  if (!view_wanted) return;
  auto made = view(flight);
  const std::scoped_lock queue(flight.queue_mutex);
  flight.view = std::move(made);
  flight.view_made = steady_now();
}

void MissionService::State::note_radios(const flight::LiveRow& row) {
  const auto* judged = std::get_if<flight::JudgedRange>(&row);
  if (judged == nullptr) return;
  const Range& range = judged->range;
  const SteadyTime now = steady_now();
  radios.heard(range.tag, range.kind == RangeKind::tag_anchor, judged->time, now);
  radios.heard(range.anchor, false, judged->time, now);
}

void MissionService::State::publish_devices() {
  const UtcTime now = deps.clock.now();
  std::string rows = radios.rows_json(steady_now());
  if (const std::string more = deps.device_rows(); !more.empty()) rows += (rows.empty() ? "" : ",") + more;
  if (!rows.empty()) deps.hub.publish(Topic::devices, '[' + rows + ']', now.us());
}

}  // namespace anchord::api
