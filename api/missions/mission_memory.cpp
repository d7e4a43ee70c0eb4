#include "api/kit/memory.hpp"
#include "api/missions/mission_observer.hpp"
#include "api/missions/mission_service_state.hpp"
#include "api/stream/hub.hpp"
#include "core/localize/flight_solver.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_reads = 16;
constexpr double k_read_s = 60;

}  // namespace

void MissionService::State::evict() {
  const SteadyTime now = steady_now();
  std::vector<std::pair<SteadyTime, std::shared_ptr<Flight>>> at_rest;
  for (const auto& flight : all()) {
    const auto inbox = flight->inbox.lock();
    const bool over =
        inbox->mission.state == MissionState::finished || seconds_between(inbox->used, now) > k_silent_s;
    if (over && !flight->rebuilding && !inbox->busy()) at_rest.emplace_back(inbox->used, flight);
  }
  std::ranges::sort(at_rest, {}, [](const auto& one) { return one.first; });
  std::size_t too_many = at_rest.size() - std::min(at_rest.size(), k_most_at_rest);
  for (const auto& [used, flight] : at_rest) {
    if (too_many == 0) return;
    auto* pilot = observer.load();
    if (pilot != nullptr && pilot->flies(flight->id)) continue;
    if (take_out(*flight)) --too_many;
  }
}

bool MissionService::State::take_out(Flight& flight) {
  const auto work = flight.work.try_lock();
  if (!work || work->joint_running) return false;
  {
    auto all = known.lock();
    auto inbox = flight.inbox.lock();
    if (flight.rebuilding || inbox->busy()) return false;
    inbox->gone = true;
    all->flights.erase(flight.id);
  }
  ++evicted;
  const std::string key = to_string(flight.id);
  for (const Topic topic : {Topic::mission_state, Topic::drone_pose, Topic::rtk_status})
    deps.hub.forget(topic, key);
  for (const auto& [anchor, status] : work->live.statuses())
    deps.hub.forget(Topic::anchors_estimates, key + to_string(anchor));
  return true;
}

/// A flight of its own, which nobody else sees: nothing is told, stored or kept but the answer.
std::optional<MissionService::LiveView> MissionService::State::read(const MissionId& id) {
  const auto n_ranges = deps.measurements.count_ranges(id), n_fixes = deps.measurements.count_fixes(id);
  if (!n_ranges || !n_fixes) return std::nullopt;
  Read now{id, n_ranges.value(), n_fixes.value(), steady_now(), {}};
  if (auto before = read_before(now)) return before;
  const std::scoped_lock one_at_a_time(reading_one);
  if (auto before = read_before(now)) return before;
  const auto mission = deps.missions.mission(id);
  if (!mission) return std::nullopt;
  bool whole = false;  // else the store failed on the way
  {
    Flight flight(setup_of(mission.value()), deps.live.strand());
    start_reading(flight);
    while (rebuild_slice(flight)) {
      if (stopped) return std::nullopt;
    }
    auto work = flight.work.lock();  // of nobody else: this flight is not known
    work->live.finish();
    if (work->live.joint_is_worth_it()) {
      auto problem = joint_problem(work->live, outline_of(mission.value()));
      problem.options.canceled = [this] { return stopped.load(); };
      if (const auto solution = solve_flight(problem.flight, problem.options))
        work->live.adopt(solution.value(), problem.cut, problem.generation);
    }
    now.view = view(flight, *work);
    const auto& state = work->live.state();
    whole = state.n_ranges >= now.n_ranges && state.n_fixes >= now.n_fixes;
  }
  give_back_memory();
  if (!whole) return std::move(now.view);
  auto kept = reads.lock();
  kept->push_back(now);
  if (kept->size() > k_reads) kept->pop_front();
  return std::move(now.view);
}

std::optional<MissionService::LiveView> MissionService::State::read_before(const Read& now) {
  auto kept = reads.lock();
  std::erase_if(*kept, [&](const Read& read) { return seconds_between(read.made, now.made) > k_read_s; });
  for (const auto& read : *kept) {
    if (read.id == now.id && read.n_ranges == now.n_ranges && read.n_fixes == now.n_fixes) return read.view;
  }
  return std::nullopt;
}

void MissionService::State::forget_reads(const std::optional<MissionId>& id) {
  auto kept = reads.lock();
  std::erase_if(*kept, [&](const Read& read) { return !id || read.id == *id; });
  auto over_time = histories.lock();
  std::erase_if(*over_time, [&](const History& one) { return !id || one.id == *id; });
}

}  // namespace anchord::api
