#include "api/json/outline_json.hpp"
#include "api/services/mission_service_state.hpp"
#include "core/localize/flight_solver.hpp"

namespace anchord::api {

namespace {

constexpr std::size_t k_min_joint_ranges = 100;  // below, the own search of each anchor is as good
constexpr auto k_joint_pause = std::chrono::seconds(2);
// Times as long a pause as the last solution took: 4 % of one core at most, however long the flight.
constexpr int k_joint_rest = 24;

}  // namespace

std::string MissionService::State::outline_of(const Mission& mission) const {
  if (!deps.site_outline || !mission.site || mission.frame != TrackFrame::wgs84) return {};
  const auto site = deps.anchors.site(*mission.site);
  return site ? site.value().outline_geojson : std::string();
}

/// Under its work_mutex; nothing where a joint solution would be no better.
std::optional<JointWorker::Task> MissionService::State::joint_task(Flight& flight, const Mission& mission,
                                                                   const std::string& outline) const {
  if (flight.history.n_ranges() < k_min_joint_ranges) return std::nullopt;
  JointWorker::Task task;
  task.options.origin = flight.live.origin();
  if (flight.frame == TrackFrame::wgs84 && !task.options.origin) return std::nullopt;
  task.flight = flight.history.data(mission);
  if (task.options.origin) task.options.clues = clues_in(flight.clues, EnuFrame(*task.options.origin));
  if (!outline.empty()) task.options.outline_m = outline_in_enu(outline, *task.options.origin);
  task.options.track = deps.track;
  return task;
}

void MissionService::State::start_joint(const std::shared_ptr<Flight>& flight) {
  if (stopped || flight->rebuilding || !joint.idle()) return;
  Mission mission;
  {
    const std::scoped_lock lock(flight->queue_mutex);
    mission = flight->mission;
  }
  const std::string outline = outline_of(mission);
  const std::unique_lock lock(flight->work_mutex, std::try_to_lock);
  if (!lock || flight->joint_running || flight->ranges_since_joint == 0) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < flight->joint_not_before) return;
  auto task = joint_task(*flight, mission, outline);
  if (!task) return;
  task->done = [self = this, flight, cut = flight->history.newest(), now,
                beginning = flight->beginning](const FlightSolution* solution) {
    self->finish_joint(*flight, solution, cut, std::chrono::steady_clock::now() - now, beginning);
  };
  // Set before the worker can be done.
  flight->joint_running = true;
  flight->ranges_since_joint = 0;
  if (!joint.try_start(*std::move(task))) flight->joint_running = false, flight->ranges_since_joint = 1;
}

void MissionService::State::finish_joint(Flight& flight, const FlightSolution* solution, UtcTime cut,
                                         std::chrono::steady_clock::duration took, std::uint64_t beginning) {
  const std::scoped_lock lock(flight.work_mutex);
  flight.joint_running = false;
  flight.joint_not_before = std::chrono::steady_clock::now() +
                            std::max<std::chrono::steady_clock::duration>(k_joint_pause, k_joint_rest * took);
  if (solution == nullptr || stopped || beginning != flight.beginning) return;
  flight.live.adopt(*solution, cut);
  flight.watch.note_lag(solution->shared.lag_s.value, solution->shared.lag_s.sigma);
  announce(flight, false);
  flight.dirty = true;
}

void MissionService::tell_clues(const MissionId& id, procedure::FlightClues clues) {
  const auto flight = state_->find(id);
  if (!flight) return;
  {
    const std::scoped_lock lock(flight->queue_mutex);
    flight->new_clues = std::move(clues);
  }
  state_->schedule(flight);
}

void MissionService::State::take_clues(Flight& flight) {
  std::optional<procedure::FlightClues> clues;
  {
    const std::scoped_lock lock(flight.queue_mutex);
    clues = std::exchange(flight.new_clues, std::nullopt);
  }
  if (!clues) return;
  flight.clues = std::move(*clues);
  flight.clues_told = false;
  if (flight.history.n_ranges() > 0) ++flight.ranges_since_joint;  // worth another joint solution
}

/// Waits for the first good fix: before it there is no frame to tell them in.
void MissionService::State::tell_live(Flight& flight) {
  const auto origin = flight.live.origin();
  if (flight.clues_told || !origin) return;
  flight.live.tell(clues_in(flight.clues, EnuFrame(*origin)));
  flight.clues_told = true;
}

}  // namespace anchord::api
