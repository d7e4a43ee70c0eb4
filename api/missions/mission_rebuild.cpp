#include "api/missions/mission_service_state.hpp"
#include "core/base/guard.hpp"

namespace anchord::api {

/// The site's origin, where it has one, is that of its flights.
flight::LiveMissionSetup MissionService::State::setup_of(const Mission& mission) const {
  flight::LiveMissionSetup setup;
  setup.mission = mission;
  setup.live.track = deps.track;
  setup.goal = deps.goal;
  setup.exclusions = exclusions_of(mission.id);
  setup.priors = deps.kept_priors(mission.id);
  if (mission.site && mission.frame == TrackFrame::wgs84) {
    if (const auto site = deps.sites.site(*mission.site)) setup.live.origin = site.value().origin;
  }
  return setup;
}

std::vector<Exclusion> MissionService::State::exclusions_of(const MissionId& id) const {
  auto all = deps.exclusions.exclusions(id);
  return all ? std::move(all).value() : std::vector<Exclusion>{};
}

void MissionService::State::begin_rebuild(const std::shared_ptr<Flight>& flight) {
  const auto n = deps.measurements.count_ranges(flight->id),
             fixes = deps.measurements.count_fixes(flight->id);
  if (!n || !fixes || n.value() + fixes.value() == 0) {
    flight->rebuilding = false;
    return schedule(flight);
  }
  start_reading(*flight);
  continue_rebuild(flight);
}

void MissionService::State::start_reading(Flight& flight) const {
  auto work = flight.work.lock();
  work->rebuild = std::make_unique<Flight::Rebuild>();
  auto& r = *work->rebuild;
  r.range_filter.mission = r.fix_filter.mission = flight.id;
  r.range_filter.limit = r.fix_filter.limit = 2000;
  r.range_filter.with_cir = deps.predict_needs_cir();
  work->live.begin_reading();
}

void MissionService::State::continue_rebuild(const std::shared_ptr<Flight>& flight) {
  post(*flight->strand, [self = shared_from_this(), flight] {
    if (self->stopped) return;
    bool more = false;
    const auto ran = guarded("flight rebuilt", [&] { more = self->rebuild_slice(*flight); });
    if (more) return self->continue_rebuild(flight);
    if (ran) {
      self->end_rebuild(*flight);
    } else {  // what was read so far stands; rows that come now are not held up by it
      auto work = flight->work.lock();
      work->rebuild.reset();
      work->live.end_reading();
    }
    flight->rebuilding = false;
    self->schedule(flight);
  });
}

/// Two sorted streams merged by time, a page of each in memory; one page of either a call. False at the end.
bool MissionService::State::rebuild_slice(Flight& flight) {
  auto work = flight.work.lock();
  if (!work->rebuild) return false;  // it began anew twice, and the other round was the last
  auto& r = *work->rebuild;
  bool failed = false;
  const auto refill = [&](auto& rows, auto& filter, bool& more, auto read) {
    if (!rows.empty() || !more) return;
    auto page = read(filter);
    failed = failed || !page;
    if (!page) return;
    for (auto& row : page.value().rows) rows.push_back(std::move(row));
    filter.after = page.value().next;
    more = !filter.after.empty();
  };
  refill(r.ranges, r.range_filter, r.more_ranges, [&](auto& f) { return deps.measurements.ranges(f); });
  refill(r.fixes, r.fix_filter, r.more_fixes, [&](auto& f) { return deps.measurements.fixes(f); });
  const auto take = [&](auto& rows) {
    {
      auto inbox = flight.inbox.lock();
      inbox->ahead.note(rows.front());
    }
    const flight::LiveRow row = row_of(std::move(rows.front()));
    rows.pop_front();
    work->rebuilt.push_back(flight::identity(row));
    work->live.add(row);
  };
  while (!failed && !(r.ranges.empty() && r.fixes.empty())) {
    // A stream that has run dry in the middle waits for its next page.
    if ((r.ranges.empty() && r.more_ranges) || (r.fixes.empty() && r.more_fixes)) return true;
    if (r.fixes.empty() || (!r.ranges.empty() && r.ranges.front().time < r.fixes.front().time))
      take(r.ranges);
    else
      take(r.fixes);
  }
  work->rebuild.reset();
  std::ranges::sort(work->rebuilt);
  take_priors(flight, *work);
  work->live.end_reading();
  return false;
}

void MissionService::State::end_rebuild(Flight& flight) {
  auto work = flight.work.lock();
  publish_events(flight, *work);
  flight.dirty = true;
}

}  // namespace anchord::api
