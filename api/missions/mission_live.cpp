#include <iterator>

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
  flight::PredictedRange row{std::move(range), {}, {}};
  row.time = row.range.time;
  row.model = deps.predict(row.range);
  row.silent = !row.model && row.range.kind == RangeKind::tag_anchor && deps.models_promoted();
  row.range.cir.reset();  // a queued row needs none, and it is 4 kB
  return row;
}

template <class R>
void MissionService::State::enqueue(Flight& flight, const R& row, SteadyTime now) {
  flight::LiveRow judged = row_of(row);
  auto inbox = flight.inbox.lock();
  if (inbox->gone) return;
  inbox->last_arrival = inbox->used = now;
  (std::is_same_v<R, Fix> ? inbox->fix_arrival : inbox->range_arrival) = now;
  if (inbox->queue.size() >= k_max_queued_rows) {
    inbox->queue.pop_front();
    ++inbox->dropped;
    --queued;
  }
  inbox->queue.push_back(std::move(judged));
  inbox->closing = inbox->mission.state == MissionState::finished;
  ++queued;
}

void MissionService::State::report_position(Flight& flight, const Fix& fix) {
  std::vector<flight::PositionEvent> events;
  {
    auto positions = flight.positions.lock();
    events = positions->add(fix);
  }
  publish_events(flight, events);
}

void MissionService::State::share_origin(Flight& flight, const Flight::Work& work) {
  auto positions = flight.positions.lock();
  positions->share_origin(work.live.origin());
}

template <class R>
void MissionService::State::take_newest(std::span<const R> rows) {
  const SteadyTime now = steady_now();
  std::shared_ptr<Flight> flight;
  for (const auto& row : rows) {
    if (!flight || flight->id != row.mission) flight = find(row.mission);
    if (!flight) continue;
    // While it is read back from the store its newest row is not known.
    if (flight->rebuilding) {
      report_position(*flight, row);
      continue;
    }
    if (auto inbox = flight->inbox.lock(); !inbox->ahead.take(row)) continue;
    report_position(*flight, row);
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
    if (outcomes[i] != RowOutcome::accepted) continue;
    // Of several senders of one row the store accepts one: whoever was live with it, it has been had.
    if (auto inbox = flight->inbox.lock(); inbox->ahead.settle(rows[i])) continue;
    report_position(*flight, rows[i]);
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
    auto inbox = flight->inbox.lock();
    if (inbox->scheduled || stopped || flight->rebuilding || !inbox->busy()) return;
    inbox->scheduled = true;
  }
  post(*flight->strand, [self = shared_from_this(), flight] {
    const auto ran = guarded("live path", [&] {
      if (!self->stopped) self->work(*flight);
      if (!self->stopped && lacks_rows(*flight)) self->begin_anew(flight);
    });
    bool again = false;
    {
      auto inbox = flight->inbox.lock();
      inbox->scheduled = false;
      // Its rows are stored; a close that throws would be tried for ever.
      if (!ran) inbox->closing = false;
      again = inbox->busy();
    }
    if (again) self->schedule(flight);
  });
}

void MissionService::State::post(Executor& on, std::function<void()> task) {
  {
    auto n = running.lock();
    ++*n;
  }
  on.post([self = shared_from_this(), task = std::move(task)] {
    (void)guarded("live path", task);
    {
      auto n = self->running.lock();
      --*n;
    }
    self->idle.notify_all();
  });
}

std::deque<flight::LiveRow> MissionService::State::take_rows(Flight& flight) {
  auto inbox = flight.inbox.lock();
  const auto n = static_cast<std::ptrdiff_t>(std::min(inbox->queue.size(), k_slice));
  std::deque<flight::LiveRow> rows(std::make_move_iterator(inbox->queue.begin()),
                                   std::make_move_iterator(inbox->queue.begin() + n));
  inbox->queue.erase(inbox->queue.begin(), inbox->queue.begin() + n);
  return rows;
}

/// Once: a bulk import may be faster than the estimates for minutes.
void MissionService::State::report_dropped(Flight& flight) const {
  {
    auto inbox = flight.inbox.lock();
    if (inbox->dropped == 0 || std::exchange(inbox->behind_reported, true)) return;
  }
  deps.events.add(
      EventLevel::warning, "live.behind",
      "measurements come faster than they are estimated from: the live estimates lack some; all are "
      "stored, and are taken in once the flight is finished",
      flight.id);
}

bool MissionService::State::lacks_rows(Flight& flight) {
  const auto inbox = flight.inbox.lock();
  return inbox->dropped > 0 && inbox->queue.empty() && inbox->mission.state == MissionState::finished;
}

void MissionService::State::work(Flight& flight) {
  auto rows = take_rows(flight);
  queued -= rows.size();
  report_dropped(flight);
  auto work = flight.work.lock();
  if (flight.rebuilding) {
    // It begins anew: what was taken goes back to the head of the queue, and is worked off after what is
    // stored.
    auto inbox = flight.inbox.lock();
    queued += rows.size();
    for (auto it = rows.rbegin(); it != rows.rend(); ++it) inbox->queue.push_front(std::move(*it));
    return;
  }
  take_given(flight, *work);
  std::size_t since_announced = 0;
  const SteadyTime now = steady_now();
  for (const auto& row : rows) {
    if (!work->rebuilt.empty() && std::ranges::binary_search(work->rebuilt, flight::identity(row))) continue;
    note_radios(row, now);
    work->live.add(row);
    if (++since_announced == k_announced) {
      work->live.settle();
      since_announced = 0;
    }
    publish_events(flight, *work);
  }
  bool closing = false;
  if (auto inbox = flight.inbox.lock(); inbox->queue.empty()) {
    work->rebuilt = {};
    closing = std::exchange(inbox->closing, false);
  }
  if (closing) work->live.finish();
  work->live.settle();
  publish_events(flight, *work);
  share_origin(flight, *work);
  flight.dirty = true;
  make_view(flight, *work);
}

/// For one who asked and did not wait.
void MissionService::State::make_view(Flight& flight, const Flight::Work& work) const {
  if (auto inbox = flight.inbox.lock(); !std::exchange(inbox->view_wanted, false)) return;
  auto made = view(flight, work);
  auto inbox = flight.inbox.lock();
  inbox->view = std::move(made);
  inbox->view_made = steady_now();
}

void MissionService::State::note_radios(const flight::LiveRow& row, SteadyTime now) {
  const auto* judged = std::get_if<flight::PredictedRange>(&row);
  if (judged == nullptr) return;
  const Range& range = judged->range;
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
