#include "api/missions/mission_service.hpp"

#include "api/admin/event_log.hpp"
#include "api/kit/current_sites.hpp"
#include "api/missions/mission_service_state.hpp"
#include "api/stream/hub.hpp"

namespace anchord::api {
namespace {

constexpr double k_view_s = 2;  ///< old, the estimates that were made for one who does not wait

}  // namespace

MissionService::MissionService(Deps deps) : state_(std::make_shared<State>(std::move(deps))) {}
MissionService::~MissionService() { stop(); }

void MissionService::observe(MissionObserver* observer) { state_->observer = observer; }

Result<Mission> MissionService::mission(const MissionId& id) {
  std::uint64_t forgotten = 0;
  {
    const auto known = state_->known.lock();
    const auto it = known->cache.find(id);
    // One that is not of the sites is asked of the store, which has none for them.
    if (it != known->cache.end() && current_sites().holds(it->second.site)) return it->second;
    forgotten = known->forgotten;
  }
  BOOST_OUTCOME_TRY(auto mission, state_->deps.missions.mission(id));
  state_->deps.hub.mission_is_of(id, mission.site);
  auto known = state_->known.lock();
  if (known->cache.size() > 1000) known->cache.clear();
  if (forgotten == known->forgotten) known->cache[id] = mission;
  return mission;
}

Result<void> MissionService::create(const Mission& mission) {
  BOOST_OUTCOME_TRY(state_->deps.missions.insert(mission));
  prepare(mission.id);
  state_->deps.events.add(EventLevel::info, "mission.started", mission.name + " started", mission.id);
  if (const auto flight = state_->find(mission.id)) {
    const auto work = flight->work.lock();
    state_->deps.hub.publish(Topic::mission_state, mission_state_json(mission, work->live.state()),
                             mission.created.us(), to_string(mission.id), {}, mission.id);
  }
  return boost::outcome_v2::success();
}

Result<Mission> MissionService::finish(const MissionId& id) {
  BOOST_OUTCOME_TRY(const auto current, state_->deps.missions.finish(id, state_->deps.clock.now()));
  ++state_->finished;
  {
    auto known = state_->known.lock();
    known->cache[id] = current;
  }
  if (const auto flight = state_->find(id)) {
    {
      auto inbox = flight->inbox.lock();
      inbox->mission = current;
      inbox->closing = true;
    }
    flight->dirty = true;
    state_->schedule(flight);
  }
  state_->forget_reads(id);
  state_->deps.events.add(EventLevel::info, "mission.finished", current.name + " finished", id);
  return current;
}

Result<Mission> MissionService::correct(const MissionId& id,
                                        const std::function<Mission(const Mission&)>& edit) {
  const std::scoped_lock one_at_a_time(state_->correcting_one);
  BOOST_OUTCOME_TRY(const auto before, state_->deps.missions.mission(id));
  const Mission after = edit(before);
  if (before.state != MissionState::finished)
    return make_error(Errc::conflict, before.name + " is recording: it can be corrected once it is finished");
  BOOST_OUTCOME_TRYV(state_->deps.missions.update(after));
  forget(id);
  prepare(id);
  return after;
}

void MissionService::forget(const MissionId& id) {
  state_->forget_reads(id);
  std::shared_ptr<Flight> gone;  // ends without the lock
  {
    auto known = state_->known.lock();
    ++known->forgotten;
    known->cache.erase(id);
    if (const auto node = known->flights.extract(id)) gone = node.mapped();
  }
  for (const Topic topic : {Topic::mission_state, Topic::drone_pose, Topic::rtk_status})
    state_->deps.hub.forget(topic, to_string(id));
  state_->deps.hub.mission_is_of(id, std::nullopt);
}

void MissionService::prepare(const MissionId& id) {
  if (state_->find(id)) return;
  const auto record = mission(id);
  if (!record) return;
  auto flight = std::make_shared<Flight>(state_->setup_of(record.value()), state_->deps.live.strand());
  {
    auto inbox = flight->inbox.lock();
    inbox->used = state_->steady_now();
  }
  // Set before it can be found: rows that come meanwhile wait in the queue.
  flight->rebuilding = true;
  {
    auto known = state_->known.lock();
    if (!known->flights.emplace(id, flight).second) return;
  }
  state_->begin_rebuild(flight);
  state_->evict();
}

void MissionService::resume() {
  constexpr std::size_t k_newest = 5;
  const auto newest = state_->deps.missions.missions(k_newest, std::nullopt);
  if (!newest) return;
  for (const auto& mission : newest.value()) {
    if (mission.state == MissionState::recording) prepare(mission.id);
  }
}

void MissionService::exclusions_changed(const MissionId& id) {
  state_->forget_reads(id);
  const auto flight = state_->find(id);
  if (!flight) return;
  state_->begin_anew(flight);
}

bool MissionService::wants_cir() const { return state_->deps.predict_needs_cir(); }

void MissionService::note_in_flights(const std::string& code, const std::string& text) {
  state_->forget_reads(std::nullopt);  // the models that judged their ranges may be others now
  std::vector<MissionId> recording;
  {
    const auto known = state_->known.lock();
    for (const auto& [id, flight] : known->flights) {
      const auto inbox = flight->inbox.lock();
      if (inbox->mission.state == MissionState::recording) recording.push_back(id);
    }
  }
  for (const auto& id : recording) state_->deps.events.add(EventLevel::info, code, text, id);
}

void MissionService::arrived(std::span<const Range> ranges) { state_->take_newest(ranges); }
void MissionService::arrived(std::span<const Fix> fixes) { state_->take_newest(fixes); }
void MissionService::accepted(std::span<const Range> ranges, std::span<const RowOutcome> outcomes) {
  state_->accept(ranges, outcomes);
}
void MissionService::accepted(std::span<const Fix> fixes, std::span<const RowOutcome> outcomes) {
  state_->accept(fixes, outcomes);
}

std::vector<MissionService::LiveView> MissionService::live(const std::optional<MissionId>& id) {
  std::vector<std::shared_ptr<Flight>> wanted;
  if (!id) {
    wanted = state_->all();
  } else if (auto flight = state_->find(*id)) {
    wanted.push_back(std::move(flight));
  } else if (auto read = state_->read(*id); read && current_sites().holds(read->mission.site)) {
    return {*std::move(read)};
  }
  std::vector<LiveView> out;
  for (const auto& flight : wanted) {
    if (!current_sites().holds(State::mission_of(*flight).site)) continue;
    if (id) {
      auto inbox = flight->inbox.lock();
      inbox->used = state_->steady_now();
    }
    const auto work = flight->work.lock();
    out.push_back(state_->view(*flight, *work));
  }
  return out;
}

std::optional<MissionService::LiveView> MissionService::live_at_hand(const MissionId& id) {
  const auto flight = state_->find(id);
  if (!flight) return std::nullopt;
  if (const auto work = flight->work.try_lock()) return state_->view(*flight, *work);
  auto inbox = flight->inbox.lock();
  inbox->view_wanted = true;
  // One that was made for an earlier question and never fetched is none.
  auto made = std::exchange(inbox->view, std::nullopt);
  return made && seconds_between(inbox->view_made, state_->steady_now()) < k_view_s ? std::move(made)
                                                                                    : std::nullopt;
}

MissionService::LiveView MissionService::State::view(Flight& flight, const Flight::Work& work) const {
  return {mission_of(flight), work.live.origin(), work.live.estimates()};
}

void MissionService::tick() {
  for (const auto& flight : state_->all()) {
    state_->start_joint(flight);
    if (!flight->dirty) continue;
    const auto work = flight->work.try_lock();
    if (!work) continue;  // at work: the next tick reports
    flight->dirty = false;
    state_->deps.hub.publish(Topic::mission_state,
                             mission_state_json(State::mission_of(*flight), work->live.state()),
                             work->live.state().time.us(), to_string(flight->id), {}, flight->id);
  }
  if (++state_->ticks % 2 == 0) state_->publish_devices();
  state_->evict();
}

std::uint64_t MissionService::finished() const { return state_->finished; }

std::vector<FlightPulse> MissionService::pulses() {
  const SteadyTime now = state_->steady_now();
  const auto steady = std::chrono::steady_clock::now();
  std::vector<FlightPulse> out;
  for (const auto& flight : state_->all()) {
    if (flight->rebuilding) continue;
    auto work = flight->work.try_lock();
    if (!work) continue;  // at work: rows come, nothing is silent
    const auto inbox = flight->inbox.lock();
    if (inbox->mission.state != MissionState::recording) continue;
    FlightPulse pulse = work->live.watch().look(work->live.state().time, steady);
    pulse.mission = flight->id;
    pulse.name = inbox->mission.name;
    pulse.now = now;
    pulse.fix_arrival = inbox->fix_arrival;
    pulse.range_arrival = inbox->range_arrival;
    out.push_back(std::move(pulse));
  }
  return out;
}

std::size_t MissionService::queued() const { return state_->queued; }

std::size_t MissionService::followed() const {
  const auto known = state_->known.lock();
  return known->flights.size();
}

std::uint64_t MissionService::evicted() const { return state_->evicted; }

bool MissionService::recording() const {
  const SteadyTime now = state_->steady_now();
  const auto known = state_->known.lock();
  return std::any_of(known->flights.begin(), known->flights.end(), [&](const auto& entry) {
    const auto inbox = entry.second->inbox.lock();
    return inbox->mission.state == MissionState::recording && seconds_between(inbox->last_arrival, now) < 5;
  });
}

void MissionService::stop() {
  state_->stopped = true;
  auto running = state_->running.lock();
  // Tasks that nobody ever ran must not hold the shutdown up for ever.
  running.wait_for(state_->idle, std::chrono::seconds(5), [](int n) { return n == 0; });
}

}  // namespace anchord::api
