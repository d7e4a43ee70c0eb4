#include "api/kit/memory.hpp"
#include "api/missions/mission_service_state.hpp"
#include "api/wire/outline_json.hpp"
#include "core/base/guard.hpp"
#include "core/localize/flight_solver.hpp"

namespace anchord::api {

namespace {

constexpr auto k_joint_pause = std::chrono::seconds(2);
// Times as long a pause as the last solution took: 4 % of one core at most, however long the flight.
constexpr int k_joint_rest = 24;

}  // namespace

GeoRings MissionService::State::outline_of(const Mission& mission) const {
  if (!deps.site_outline || !mission.site || mission.frame != TrackFrame::wgs84) return {};
  const auto site = deps.sites.site(*mission.site);
  return site ? site.value().outline : GeoRings{};
}

flight::LiveMission::JointProblem MissionService::State::joint_problem(flight::LiveMission& live,
                                                                       const GeoRings& outline) {
  const auto origin = live.origin();
  return live.joint_problem(origin && !outline.empty() ? outline_in_enu(outline, *origin)
                                                       : std::vector<Eigen::Vector2d>{});
}

void MissionService::State::start_joint(const std::shared_ptr<Flight>& flight) {
  if (stopped || flight->rebuilding || joint_busy) return;
  const GeoRings outline = outline_of(mission_of(*flight));
  std::shared_ptr<flight::LiveMission::JointProblem> problem;
  if (auto work = flight->work.try_lock()) {
    if (work->joint_running || !work->live.joint_is_worth_it()) return;
    if (std::chrono::steady_clock::now() < work->joint_not_before) return;
    if (joint_busy.exchange(true)) return;
    problem = std::make_shared<flight::LiveMission::JointProblem>(joint_problem(work->live, outline));
    work->joint_running = true;
  }
  if (!problem) return;
  post(deps.joint, [self = shared_from_this(), flight, problem = std::move(problem)]() mutable {
    self->solve_joint(*flight, *problem);
    problem.reset();
    give_back_memory();
    self->joint_busy = false;
  });
}

void MissionService::State::solve_joint(Flight& flight, const flight::LiveMission::JointProblem& problem) {
  const auto begun = std::chrono::steady_clock::now();
  std::optional<FlightSolution> found;
  (void)guarded("joint solution", [&] {
    auto options = problem.options;
    options.canceled = [this] { return stopped.load(); };
    if (auto solution = solve_flight(problem.flight, options)) found = std::move(solution).value();
  });
  const auto took = std::chrono::steady_clock::now() - begun;
  (void)guarded("joint solution", [&] {
    finish_joint(flight, found ? &*found : nullptr, problem.cut, took, problem.generation);
  });
}

void MissionService::State::finish_joint(Flight& flight, const FlightSolution* solution, UtcTime cut,
                                         std::chrono::steady_clock::duration took, std::uint64_t generation) {
  auto work = flight.work.lock();
  work->joint_running = false;
  work->joint_not_before = std::chrono::steady_clock::now() +
                           std::max<std::chrono::steady_clock::duration>(k_joint_pause, k_joint_rest * took);
  if (solution == nullptr || stopped || !work->live.adopt(*solution, cut, generation)) return;
  publish_events(flight, *work);
  flight.dirty = true;
}

void MissionService::set_priors(const MissionId& id, procedure::FlightPriors priors) {
  const auto flight = state_->find(id);
  if (!flight) return;
  {
    auto inbox = flight->inbox.lock();
    inbox->given.priors = std::move(priors);
  }
  state_->schedule(flight);
}

void MissionService::set_targets(const MissionId& id, PlanTargets targets) {
  const auto flight = state_->find(id);
  if (!flight) return;
  {
    auto inbox = flight->inbox.lock();
    inbox->given.targets = std::move(targets);
  }
  state_->schedule(flight);
}

/// What its flight found, and what is wanted of it, since the last rows.
void MissionService::State::take_given(Flight& flight, Flight::Work& work) {
  flight::ForMission given;
  {
    auto inbox = flight.inbox.lock();
    given = std::exchange(inbox->given, {});
  }
  flight::give(work.live, std::move(given));
}

}  // namespace anchord::api
