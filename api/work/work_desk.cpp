#include "api/work/work_desk.hpp"

#include <algorithm>
#include <condition_variable>
#include <set>

#include "api/admin/event_log.hpp"
#include "api/kit/problem.hpp"
#include "api/work/work_runner.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/ports/executor.hpp"

namespace anchord::api {
namespace {

constexpr auto k_look_every = std::chrono::milliseconds(500);
/// A worker looks once a second: one that was not seen for so long is busy with nothing of ours, or away.
constexpr double k_there_s = 10;
/// So long a job is left to the workers that are there, before the server takes it.
constexpr auto k_left_to_workers = std::chrono::seconds(3);
constexpr double k_alarm_s = 60;
/// What is left to do with a result, of the whole.
constexpr double k_share_of_work = 0.98;

bool job_ended(const Job& job) { return job.state != JobState::queued && job.state != JobState::running; }

bool same(const Job& a, const Job& b) {
  return a.state == b.state && a.fraction == b.fraction && a.stage == b.stage && a.detail == b.detail &&
         a.worker == b.worker && a.attempts == b.attempts;
}

bool store_away(const Error& error) {
  return error.code == Errc::storage_unavailable || error.code == Errc::storage_full ||
         error.code == Errc::queue_full;
}

}  // namespace

struct WorkDesk::State {
  explicit State(Deps d)
      : deps(std::move(d)),
        runner({deps.work, deps.run, deps.options.worker, deps.options.version, deps.options.lease, false,
                [](std::string_view, const WorkClaim&, std::string_view) {}}) {}

  struct Now {
    bool stopping{false}, look{true};
    std::set<std::string> busy{};  ///< kinds of which one runs here
    std::string alarm{};
  };
  Deps deps;
  WorkRunner runner;
  std::map<std::string, Kind> kinds;
  Locked<Now> now;
  std::condition_variable changed;
  std::map<std::string, std::unique_ptr<Executor>> strands;  ///< of the thread alone, by kind
  Thread thread;
  bool anything{true};  ///< of the thread alone: something was out when it looked last

  void kick() {
    {
      auto n = now.lock();
      n->look = true;
    }
    changed.notify_all();
  }
  bool stopping() {
    const auto n = now.lock();
    return n->stopping;
  }
  void work();
  Result<void> round();
  Result<void> follow(const WorkStatus& status);
  bool made_by_another(const WorkStatus& status) const;
  Result<void> hand_out_anew(const WorkStatus& status);
  Result<void> conclude(const WorkStatus& status, Job job);
  Result<void> look_after_waiting(const std::vector<WorkStatus>& all);
  Result<Job> handed_out(Job job, std::string message);
  void run_here(const std::string& kind, std::chrono::milliseconds left_alone);
  /// How far the job is, of what its work says.
  double share(const std::string& kind, double of_work) const {
    const auto how = kinds.find(kind);
    const double before = how == kinds.end() ? 0 : how->second.done_before;
    return before + (k_share_of_work - before) * of_work;
  }
  void raise(std::string alarm) {
    auto n = now.lock();
    n->alarm = std::move(alarm);
  }
};

/// Asks the database only while something is out.
void WorkDesk::State::work() {
  while (true) {
    {
      auto n = now.lock();
      n.wait_for(changed, k_look_every, [](const Now& s) { return s.stopping || s.look; });
      if (n->stopping) return;
      if (!n->look && !anything) continue;
      n->look = false;
    }
    // A database that is away is told of by its own alarm; we look again.
    (void)guarded("jobs of workers", [this] { (void)round().has_value(); });
  }
}

Result<void> WorkDesk::State::round() {
  anything = true;  // until we know better
  BOOST_OUTCOME_TRYV(deps.work.end_hopeless());
  BOOST_OUTCOME_TRY(const auto all, deps.work.all());
  for (const auto& status : all) {
    // What is wrong with one must not keep the others waiting.
    (void)guarded("job of a worker", [&] { (void)follow(status).has_value(); });
  }
  anything = !all.empty();
  return look_after_waiting(all);
}

/// The job becomes what the work is.
Result<void> WorkDesk::State::follow(const WorkStatus& status) {
  BOOST_OUTCOME_TRY(const auto before, deps.job_store.job(status.job));
  // A server that was killed between the last two steps of a job.
  if (job_ended(before)) return deps.work.remove(status.job, status.fence);
  Job job = before;
  job.attempts = status.attempts;
  job.worker = status.worker;
  if (status.version != deps.options.version && (status.waiting_s > 0 || made_by_another(status)))
    return hand_out_anew(status);
  if (status.state == WorkState::done) return conclude(status, std::move(job));
  const bool claimed = status.state == WorkState::claimed;
  job.state = claimed ? JobState::running : JobState::queued;
  job.fraction = share(status.kind, claimed ? status.fraction : 0);
  job.stage = status.stage;
  job.detail = claimed ? status.detail : status.fault;
  if (claimed && !job.started) job.started = deps.clock.now();
  if (same(job, before)) return boost::outcome_v2::success();
  if (claimed && status.attempts > 1 && before.attempts < status.attempts && !status.fault.empty())
    deps.events.add(EventLevel::warning, "job.taken_over",
                    "job " + to_string(job.id) + " (" + job.kind + "): " + status.fault + "; attempt " +
                        std::to_string(status.attempts) + " of " + std::to_string(status.max_attempts) +
                        " is of " + status.worker);
  return deps.jobs.save(job);
}

bool WorkDesk::State::made_by_another(const WorkStatus& status) const {
  const auto how = kinds.find(status.kind);
  return status.state == WorkState::done && how != kinds.end() && how->second.of_one_version;
}

/// The server was updated meanwhile: its workers would never claim what the former one wrote.
Result<void> WorkDesk::State::hand_out_anew(const WorkStatus& status) {
  const auto how = kinds.find(status.kind);
  if (how == kinds.end()) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(auto message, how->second.message(status.job));
  return deps.work.offer({status.job, status.kind, deps.options.version, std::move(message)});
}

Result<void> WorkDesk::State::conclude(const WorkStatus& status, Job job) {
  BOOST_OUTCOME_TRY(const auto outcome, deps.work.outcome(status.job));
  Result<JobEnd> end =
      make_error(Errc::internal, "this server has no handler for the result of a job of kind " + job.kind);
  if (outcome.error) {
    end = *outcome.error;
  } else if (const auto how = kinds.find(job.kind); how != kinds.end()) {
    job.stage = "store";
    job.fraction = k_share_of_work;
    const auto ran = guarded("job", [&] { end = how->second.take_in(job, outcome.result); });
    if (!ran) end = make_error(Errc::internal, ran.what);
  }
  if (!end && store_away(end.error())) return end.error();  // the result is kept: the next round takes it in
  job.finished = deps.clock.now();
  if (end) {
    job.state = JobState::succeeded;
    job.fraction = 1;
    job.detail = end.value().detail;
    job.result_href = end.value().result_href;
  } else if (end.error().code == Errc::canceled) {
    job.state = JobState::canceled;
  } else {
    job.state = JobState::failed;
    job.problem = {problem_of(end.error()).body};
  }
  BOOST_OUTCOME_TRYV(deps.jobs.save(job));
  return deps.work.remove(status.job, status.fence);
}

Result<void> WorkDesk::State::look_after_waiting(const std::vector<WorkStatus>& all) {
  double longest_s = 0;
  std::set<std::string> waiting;
  for (const auto& one : all) {
    if (one.state == WorkState::done || one.waiting_s <= 0) continue;
    waiting.insert(one.kind);
    longest_s = std::max(longest_s, one.waiting_s);
  }
  if (waiting.empty()) {
    raise({});
    return boost::outcome_v2::success();
  }
  BOOST_OUTCOME_TRY(const auto workers, deps.work.workers());
  const auto there = [&](double within_s) {
    return std::ranges::any_of(workers, [&](const WorkerStatus& w) {
      return w.version == deps.options.version && w.seen_s_ago < within_s;
    });
  };
  if (deps.options.run_here) {
    const std::chrono::milliseconds left_alone{there(k_there_s) ? k_left_to_workers
                                                                : std::chrono::seconds(0)};
    for (const auto& kind : waiting) run_here(kind, left_alone);
    return boost::outcome_v2::success();
  }
  if (longest_s < k_alarm_s || there(k_alarm_s)) {
    raise({});
    return boost::outcome_v2::success();
  }
  const bool others = std::ranges::any_of(workers, [&](const auto& w) { return w.seen_s_ago < k_alarm_s; });
  raise(others ? "jobs are waiting, and the running workers have another version than this server (" +
                     deps.options.version + "): install the same version"
               : "jobs are waiting and no worker has been seen for one minute: start anchord worker "
                 "--database, or set jobs.run_here to on");
  return boost::outcome_v2::success();
}

/// One of a kind at a time: a calibration never waits for a training run.
void WorkDesk::State::run_here(const std::string& kind, std::chrono::milliseconds left_alone) {
  {
    auto n = now.lock();
    if (n->stopping || !n->busy.insert(kind).second) return;
  }
  auto& strand = strands[kind];
  if (!strand) strand = deps.on.strand();
  strand->post([this, kind, left_alone] {
    (void)guarded("job", [&] {
      (void)runner
          .run_one(
              left_alone, [this] { return stopping(); }, kind)
          .has_value();
    });
    // Under the lock to its last line: who waits for it in stop() may take everything down right after.
    auto n = now.lock();
    n->busy.erase(kind);
    n->look = true;
    changed.notify_all();
  });
}

/// A job that could not be handed out has failed: nobody would ever begin it.
Result<Job> WorkDesk::State::handed_out(Job job, std::string message) {
  const auto offered = deps.work.offer({job.id, job.kind, deps.options.version, std::move(message)});
  if (!offered) {
    job.state = JobState::failed;
    job.finished = deps.clock.now();
    job.problem = {problem_of(offered.error()).body};
    (void)deps.jobs.save(job).has_value();
    return offered.error();
  }
  kick();
  return job;
}

WorkDesk::WorkDesk(Deps deps) : state_(std::make_shared<State>(std::move(deps))) {
  state_->deps.jobs.cancel_elsewhere([s = state_.get()](const JobId& id) -> Result<bool> {
    auto there = s->deps.work.cancel(id);
    s->kick();
    return there;
  });
}

WorkDesk::~WorkDesk() { stop(); }

void WorkDesk::add(std::string kind, Kind how) {
  state_->kinds.insert_or_assign(std::move(kind), std::move(how));
}

void WorkDesk::start() {
  state_->thread = Thread("anchord-desk", [s = state_.get()] { s->work(); });
}

void WorkDesk::stop() {
  {
    auto n = state_->now.lock();
    n->stopping = true;
  }
  state_->changed.notify_all();
  if (state_->thread.joinable()) state_->thread.join();
  auto n = state_->now.lock();
  n.wait(state_->changed, [](const State::Now& s) { return s.busy.empty(); });
}

Result<void> WorkDesk::room_for(const std::string& kind) {
  BOOST_OUTCOME_TRY(const auto all, state_->deps.work.all());
  const auto waiting = std::ranges::count_if(
      all, [&](const WorkStatus& w) { return w.kind == kind && w.state == WorkState::open; });
  if (static_cast<std::size_t>(waiting) >= JobService::k_max_queued)
    return make_error(Errc::queue_full, std::to_string(waiting) + " jobs are waiting already");
  return boost::outcome_v2::success();
}

Result<Job> WorkDesk::submit(std::string kind, std::string request_json, std::string message,
                             const JobId& id) {
  auto& s = *state_;
  BOOST_OUTCOME_TRYV(room_for(kind));
  BOOST_OUTCOME_TRY(auto job, s.deps.jobs.submit_elsewhere(std::move(kind), std::move(request_json), id));
  return s.handed_out(std::move(job), std::move(message));
}

Result<Job> WorkDesk::restart(const JobId& id, std::string message) {
  auto& s = *state_;
  BOOST_OUTCOME_TRY(const auto before, s.deps.job_store.job(id));
  // What is left of its former life must not end the new one; while it lives, restart_elsewhere refuses.
  if (job_ended(before)) {
    BOOST_OUTCOME_TRYV(s.deps.work.remove(id));
  }
  BOOST_OUTCOME_TRY(auto job, s.deps.jobs.restart_elsewhere(id));
  return s.handed_out(std::move(job), std::move(message));
}

Result<void> WorkDesk::hand_over(Job job, std::string message) {
  auto& s = *state_;
  job.state = JobState::queued;
  job.stage = "queued";
  job.fraction = s.share(job.kind, 0);
  job.attempts = 0;  // those of its work count
  BOOST_OUTCOME_TRYV(s.deps.jobs.save(job));
  BOOST_OUTCOME_TRYV(s.deps.work.offer({job.id, job.kind, s.deps.options.version, std::move(message)}));
  s.kick();
  return boost::outcome_v2::success();
}

std::vector<AlarmCondition> WorkDesk::alarms() const {
  const auto n = state_->now.lock();
  if (n->alarm.empty()) return {};
  return {{"jobs.no_worker", AlarmPriority::warning, n->alarm, std::nullopt}};
}

}  // namespace anchord::api
