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
  setup.targets = deps.kept_targets(mission.id);
  if (mission.site && mission.frame == TrackFrame::wgs84) {
    if (const auto site = deps.sites.site(*mission.site)) setup.live.origin = site.value().origin;
  }
  return setup;
}

std::vector<Exclusion> MissionService::State::exclusions_of(const MissionId& id) const {
  auto all = deps.exclusions.exclusions(id);
  return all ? std::move(all).value() : std::vector<Exclusion>{};
}

void MissionService::State::begin_anew(const std::shared_ptr<Flight>& flight) {
  // Rows that come from here on wait in the queue until what is stored is in.
  flight->rebuilding = true;
  {
    auto inbox = flight->inbox.lock();
    inbox->ahead.forget();
    inbox->dropped = 0;
    inbox->behind_reported = false;
  }
  {
    auto exclusions = exclusions_of(flight->id);
    {
      auto positions = flight->positions.lock();
      positions->begin_anew(exclusions);
    }
    auto work = flight->work.lock();
    work->live.begin_anew(std::move(exclusions));
    work->rebuilt.clear();
  }
  begin_rebuild(flight);
}

void MissionService::State::begin_rebuild(const std::shared_ptr<Flight>& flight) {
  {
    auto inbox = flight->inbox.lock();
    inbox->closing = inbox->mission.state == MissionState::finished;
  }
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
  work->rebuild = std::make_unique<StoredRows>(deps.measurements, flight.id, deps.predict_needs_cir());
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

/// A page of the stored rows a call, so that what else waits for this flight gets its turn. False at the end.
bool MissionService::State::rebuild_slice(Flight& flight) {
  auto work = flight.work.lock();
  if (!work->rebuild) return false;  // it began anew twice, and the other round was the last
  for (std::size_t n = 0; n < StoredRows::k_page; ++n) {
    auto stored = work->rebuild->next();
    if (!stored) {
      work->rebuild.reset();
      std::ranges::sort(work->rebuilt);
      take_given(flight, *work);
      work->live.end_reading();
      return false;
    }
    {
      auto inbox = flight.inbox.lock();
      std::visit([&](const auto& row) { inbox->ahead.note(row); }, *stored);
    }
    if (const auto* fix = std::get_if<Fix>(&*stored);
        fix != nullptr && (!work->newest_stored || work->newest_stored->time < fix->time))
      work->newest_stored = *fix;
    const flight::LiveRow row = std::visit([&](auto& one) { return row_of(std::move(one)); }, *stored);
    work->rebuilt.push_back(flight::identity(row));
    work->live.add(row);
  }
  return true;
}

void MissionService::State::end_rebuild(Flight& flight) {
  auto work = flight.work.lock();
  publish_events(flight, *work);
  flight.dirty = true;
  // After a restart the page shows where the aircraft was last; to the pilot that is no news.
  std::optional<flight::PoseMoved> pose;
  {
    auto positions = flight.positions.lock();
    positions->share_origin(work->live.origin());
    if (!positions->pose() && work->newest_stored) (void)positions->add(*work->newest_stored);
    pose = positions->pose();
  }
  if (pose) publish(flight, *pose);
}

}  // namespace anchord::api
