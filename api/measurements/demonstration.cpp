#include "api/measurements/demonstration.hpp"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "api/admin/event_log.hpp"
#include "api/missions/mission_service.hpp"
#include "core/base/time.hpp"
#include "core/ports/devices.hpp"

namespace anchord::api {
namespace {

using Steady = std::chrono::steady_clock;
constexpr auto k_tick = std::chrono::milliseconds(100);

template <class Row>
void prepare(std::vector<Row>& rows, const MissionId& mission) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].seq) rows[i].seq = i;
    rows[i].mission = mission;
  }
  std::ranges::stable_sort(rows, {}, &Row::time);
}

template <class Row>
std::vector<Row> taken_before(const std::vector<Row>& rows, std::size_t& next, UtcTime until) {
  const auto from = rows.begin() + static_cast<std::ptrdiff_t>(next);
  const auto to = std::ranges::lower_bound(from, rows.end(), until, {}, &Row::time);
  next = static_cast<std::size_t>(to - rows.begin());
  return {from, to};
}

}  // namespace

struct Demonstration::Rows {
  FlightData flight;
  std::size_t next_fix{0}, next_range{0};

  bool done() const { return next_fix == flight.fixes.size() && next_range == flight.ranges.size(); }
  UtcTime first() const { return std::min(flight.fixes.front().time, flight.ranges.front().time); }
  UtcTime last() const { return std::max(flight.fixes.back().time, flight.ranges.back().time); }
  void shift(std::int64_t ns) {
    for (auto& fix : flight.fixes) fix.time.ns += ns;
    for (auto& range : flight.ranges) range.time.ns += ns;
  }
};

Result<Mission> Demonstration::start(double speed) {
  if (!deps_.make) return make_error(Errc::unsupported, "this server has no demonstration flight");
  Thread last;
  {
    auto playing = playing_.lock();
    if (playing->stopping) return make_error(Errc::conflict, "the server is stopping");
    if (std::exchange(playing->now, true))
      return make_error(Errc::conflict, "the demonstration is already being flown: wait until it has ended");
    last = std::move(playing->thread);
  }
  if (last.joinable()) last.join();  // it has ended
  auto begun = begin(speed);
  if (!begun) {
    auto playing = playing_.lock();
    playing->now = false;
  }
  return begun;
}

Result<Mission> Demonstration::begin(double speed) {
  BOOST_OUTCOME_TRY(auto flight, deps_.make());
  if (flight.fixes.empty() || flight.ranges.empty())
    return make_error(Errc::unsupported, "the demonstration flight measured nothing");
  const UtcTime now = deps_.clock.now();
  Mission mission = flight.mission;
  mission.created = now;
  mission.id.uuid = make_uuid_v7(now);
  mission.name = "Demonstration";
  BOOST_OUTCOME_TRYV(deps_.missions.create(mission));
  auto rows = std::make_shared<Rows>(Rows{std::move(flight)});
  prepare(rows->flight.fixes, mission.id);
  prepare(rows->flight.ranges, mission.id);
  // It ends when its playback ends: what is between two rows stays as it was, and none is of the future.
  const double length_s = seconds_between(rows->first(), rows->last());
  rows->shift(now.ns + static_cast<std::int64_t>(length_s / speed * 1e9) - rows->last().ns);
  auto playing = playing_.lock();
  if (playing->stopping) return make_error(Errc::conflict, "the server is stopping");
  playing->thread = Thread("anchord-demo", [this, id = mission.id, rows, speed] {
    (void)guarded("demonstration", [&] { play(id, *rows, speed); });
    auto end = playing_.lock();
    end->now = false;
  });
  return mission;
}

void Demonstration::play(const MissionId& id, Rows& rows, double speed) {
  const UtcTime first = rows.first();
  const auto start = Steady::now();
  auto next = start;
  while (!rows.done()) {
    {
      auto playing = playing_.lock();
      if (playing.wait_until(wake_, next, [](const Playing& p) { return p.stopping; })) return;
    }
    const double elapsed_s = std::chrono::duration<double>(Steady::now() - start).count();
    const UtcTime until{first.ns + static_cast<std::int64_t>(elapsed_s * speed * 1e9)};
    DeviceBatch batch{taken_before(rows.flight.fixes, rows.next_fix, until),
                      taken_before(rows.flight.ranges, rows.next_range, until)};
    next = std::max(next + k_tick, Steady::now());
    if (batch.empty()) continue;
    deps_.rows.live(batch);
    if (const auto stored = deps_.rows.store(batch); !stored) {
      deps_.events.add(EventLevel::warning, "demonstration.ended",
                       "the demonstration ended: " + stored.error().message, id);
      return;
    }
  }
  if (const auto finished = deps_.missions.finish(id); !finished)
    deps_.events.add(EventLevel::warning, "demonstration.ended", finished.error().message, id);
}

void Demonstration::stop() {
  Thread last;
  {
    auto playing = playing_.lock();
    playing->stopping = true;
    last = std::move(playing->thread);
  }
  wake_.notify_all();
  if (last.joinable()) last.join();
}

}  // namespace anchord::api
