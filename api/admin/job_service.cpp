#include "api/admin/job_service.hpp"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "api/admin/job_json.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/memory.hpp"
#include "api/kit/problem.hpp"
#include "api/stream/hub.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/executor.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_max_for_sites = 1000;

bool ended(JobState state) { return state != JobState::queued && state != JobState::running; }

Job new_job(UtcTime now, std::string kind, std::string request_json, std::optional<JobId> id) {
  Job job;
  job.created = now;
  job.id = id.value_or(JobId{make_uuid_v7(now)});
  job.kind = std::move(kind);
  job.stage = "queued";
  job.request = {std::move(request_json)};
  return job;
}

Result<Job> begun_anew(const Job& before) {
  if (before.state == JobState::succeeded) return make_error(Errc::conflict, "the job has succeeded");
  if (!ended(before.state)) return make_error(Errc::conflict, "the job is already waiting or running");
  Job job = new_job(before.created, before.kind, before.request.text, before.id);
  job.result_href = before.result_href;
  return job;
}

}  // namespace

struct JobService::State {
  State(JobStore& j, Hub& h, const Clock& c, Executor& e) : jobs(j), hub(h), clock(c), on(e) {}
  struct Task {
    JobId id{};
    Work work{};
  };
  /// One kind of job.
  struct Lane {
    std::deque<Task> queue;
    std::unique_ptr<Executor> strand;
  };
  class Context;

  JobStore& jobs;
  Hub& hub;
  const Clock& clock;
  Executor& on;
  struct Lanes {
    std::map<std::string, Lane> of_kind{};
    std::set<JobId> canceled{};
    std::map<JobId, SiteSet> for_sites{};  ///< of those that were submitted for some sites alone
    bool started{false}, stopping{false};
    int posted{0};             ///< turns that the executor has not finished
    std::uint64_t changes{0};  ///< of states of jobs
  };
  std::condition_variable changed;
  std::function<Result<bool>(const JobId&)> cancel_elsewhere;
  Locked<Lanes> lanes;

  void publish(const Job& job) {
    hub.publish(Topic::jobs, to_wire(job_json(job)), clock.now().us(), to_string(job.id));
  }
  void save(const Job& job) {
    // A job that cannot be written is still shown live; after a restart it counts as interrupted.
    (void)jobs.update(job).has_value();
    announce(job);
  }
  void announce(const Job& job) {
    publish(job);
    {
      auto now = lanes.lock();
      ++now->changes;
    }
    changed.notify_all();
  }
  std::uint64_t changes() {
    const auto now = lanes.lock();
    return now->changes;
  }
  bool is_canceled(const JobId& id) {
    const auto now = lanes.lock();
    return now->stopping || now->canceled.contains(id);
  }
  bool is_stopping() {
    const auto now = lanes.lock();
    return now->stopping;
  }
  /// Room in the lane, told before the job is written.
  Result<void> admit(const std::string& kind) {
    auto now = lanes.lock();
    if (now->stopping) return make_error(Errc::queue_full, "the server is stopping");
    if (now->of_kind[kind].queue.size() >= k_max_queued)
      return make_error(Errc::queue_full, std::to_string(k_max_queued) + " jobs are waiting already");
    return boost::outcome_v2::success();
  }
  void enqueue(const std::shared_ptr<State>& self, const Job& job, Work work) {
    publish(job);
    {
      auto now = lanes.lock();
      now->canceled.erase(job.id);  // of an earlier life of the same job
      now->of_kind[job.kind].queue.push_back({job.id, std::move(work)});
      if (!now->started || now->stopping) return;
    }
    post_turn(self, job.kind);
  }
  /// One for each job that waits: what was canceled meanwhile leaves a turn without a job.
  void post_turn(const std::shared_ptr<State>& self, const std::string& kind) {
    Executor* strand = nullptr;
    {
      auto now = lanes.lock();
      auto& lane = now->of_kind[kind];
      if (!lane.strand) lane.strand = on.strand();
      strand = lane.strand.get();
      ++now->posted;
    }
    strand->post([self, kind] {
      (void)guarded("job", [&] { self->turn(kind); });
      {
        auto now = self->lanes.lock();
        --now->posted;
      }
      self->changed.notify_all();
    });
  }
  void turn(const std::string& kind);
  void run(const Task& task);
};

class JobService::State::Context final : public JobContext {
 public:
  Context(State& state, Job& job) : state_(state), job_(job) {}
  const Job& job() const override { return job_; }
  void progress(double fraction, std::string stage, std::string detail) override {
    const bool new_stage = job_.stage != stage;
    job_.fraction = fraction;
    job_.stage = std::move(stage);
    job_.detail = std::move(detail);
    // Every write is an fsync that flights share: the store gets what is worth keeping, the hub all of it.
    const auto now = std::chrono::steady_clock::now();
    if (new_stage || now - saved_ >= std::chrono::seconds(1)) {
      saved_ = now;
      state_.save(job_);
    } else {
      state_.publish(job_);
    }
  }
  bool canceled() const override { return state_.is_canceled(job_.id); }

 private:
  State& state_;
  Job& job_;
  std::chrono::steady_clock::time_point saved_{};
};

JobService::JobService(JobStore& jobs, Hub& hub, const Clock& clock, Executor& on)
    : state_(std::make_shared<State>(jobs, hub, clock, on)) {}
JobService::~JobService() { stop(); }

void JobService::start() {
  const auto problem = problem_json(
      503, "internal", "interrupted: the server was restarted while the job was running; start it again");
  (void)state_->jobs.fail_unfinished(state_->clock.now(), {problem}).has_value();
  std::vector<std::string> turns;
  {
    auto now = state_->lanes.lock();
    now->started = true;
    for (const auto& [kind, lane] : now->of_kind) turns.insert(turns.end(), lane.queue.size(), kind);
  }
  for (const auto& kind : turns) state_->post_turn(state_, kind);
}

void JobService::stop() {
  auto lanes = state_->lanes.lock();
  lanes->stopping = true;
  state_->changed.notify_all();
  lanes.wait(state_->changed, [](const auto& now) { return now.posted == 0; });
}

Result<Job> JobService::submit(std::string kind, std::string request_json, Work work,
                               std::optional<JobId> id) {
  const Job job = new_job(state_->clock.now(), std::move(kind), std::move(request_json), id);
  BOOST_OUTCOME_TRYV(state_->admit(job.kind));
  BOOST_OUTCOME_TRYV(state_->jobs.insert(job));
  if (!current_sites().all()) {
    work = [sites = current_sites(), work = std::move(work)](JobContext& context) {
      const ForSites theirs(sites);
      return work(context);
    };
    auto now = state_->lanes.lock();
    if (now->for_sites.size() >= k_max_for_sites) now->for_sites.erase(now->for_sites.begin());  // the oldest
    now->for_sites.emplace(job.id, current_sites().as_of_now());
  }
  state_->enqueue(state_, job, std::move(work));
  return job;
}

bool JobService::seen(const JobId& id) const {
  const SiteSet& sites = current_sites();
  if (sites.all()) return true;
  const auto now = state_->lanes.lock();
  const auto at = now->for_sites.find(id);
  if (at == now->for_sites.end()) return false;
  // Of an organization: of the sites that it had then, all of which it must still have.
  const SiteList then = at->second.sites(), own = sites.sites();
  return then == own || (!then->empty() && std::ranges::includes(*own, *then));
}

Result<Job> JobService::restart(const JobId& id, Work work) {
  BOOST_OUTCOME_TRY(const auto stored, state_->jobs.job(id));
  BOOST_OUTCOME_TRY(const auto job, begun_anew(stored));
  BOOST_OUTCOME_TRYV(state_->admit(job.kind));
  BOOST_OUTCOME_TRYV(state_->jobs.update(job));
  state_->enqueue(state_, job, std::move(work));
  return job;
}

Result<Job> JobService::submit_elsewhere(std::string kind, std::string request_json, const JobId& id) {
  const Job job = new_job(state_->clock.now(), std::move(kind), std::move(request_json), id);
  BOOST_OUTCOME_TRYV(state_->jobs.insert(job));
  state_->publish(job);
  return job;
}

Result<Job> JobService::restart_elsewhere(const JobId& id) {
  BOOST_OUTCOME_TRY(const auto stored, state_->jobs.job(id));
  BOOST_OUTCOME_TRY(const auto job, begun_anew(stored));
  BOOST_OUTCOME_TRYV(save(job));
  return job;
}

Result<void> JobService::save(const Job& job) {
  BOOST_OUTCOME_TRYV(state_->jobs.update(job));
  state_->announce(job);
  return boost::outcome_v2::success();
}

void JobService::cancel_elsewhere(std::function<Result<bool>(const JobId&)> cancel) {
  state_->cancel_elsewhere = std::move(cancel);
}

Result<Job> JobService::wait(const JobId& id, std::chrono::milliseconds longest) {
  const auto deadline = std::chrono::steady_clock::now() + longest;
  while (true) {
    const auto seen = state_->changes();  // before the job is read: what changes meanwhile ends the wait
    BOOST_OUTCOME_TRY(auto job, state_->jobs.job(id));
    auto lanes = state_->lanes.lock();
    if (ended(job.state) || lanes->stopping || std::chrono::steady_clock::now() >= deadline) return job;
    lanes.wait_until(state_->changed, deadline,
                     [&](const auto& now) { return now.stopping || now.changes != seen; });
  }
}

Result<Job> JobService::cancel(const JobId& id) {
  BOOST_OUTCOME_TRY(auto job, state_->jobs.job(id));
  if (ended(job.state)) return make_error(Errc::conflict, "the job has ended");
  if (state_->cancel_elsewhere) {
    BOOST_OUTCOME_TRY(const bool there, state_->cancel_elsewhere(id));
    if (there) return wait(id, std::chrono::seconds(1));
  }
  std::string kind = job.kind;
  bool waiting = false;
  {
    auto lanes = state_->lanes.lock();
    auto& queue = lanes->of_kind[kind].queue;
    for (auto it = queue.begin(); it != queue.end(); ++it) {
      if (it->id != id) continue;
      queue.erase(it);
      waiting = true;
      break;
    }
    if (!waiting) lanes->canceled.insert(id);
  }
  if (!waiting && state_->cancel_elsewhere) {  // it may have been handed over since we asked
    BOOST_OUTCOME_TRY(const bool there, state_->cancel_elsewhere(id));
    (void)there;
  }
  if (waiting) {
    // It never ran, so it does not wait for its turn to be told so.
    job.state = JobState::canceled;
    job.finished = state_->clock.now();
    state_->save(job);
    return job;
  }
  state_->changed.notify_all();
  return wait(id, std::chrono::seconds(1));
}

void JobService::State::turn(const std::string& kind) {
  Task task;
  {
    auto now = lanes.lock();
    auto& queue = now->of_kind[kind].queue;
    if (now->stopping || queue.empty()) return;
    task = std::move(queue.front());
    queue.pop_front();
  }
  (void)guarded("job", [&] { run(task); });
  task.work = nullptr;  // with what it holds, before its memory is given back
  give_back_memory();
  auto now = lanes.lock();
  now->canceled.erase(task.id);
}

void JobService::State::run(const Task& task) {
  auto stored = jobs.job(task.id);
  if (!stored) return;
  Job job = std::move(stored).value();
  job.state = JobState::running;
  job.started = clock.now();
  ++job.attempts;
  Context context(*this, job);
  context.progress(0, "load", "");
  Result<JobEnd> result = make_error(Errc::internal, "");
  const auto ran = guarded("job", [&] { result = task.work(context); });
  if (!ran) result = make_error(Errc::internal, ran.what);
  if (result && result.value().elsewhere) {
    // Canceled while it was handed over: whoever asked has found it in neither place.
    if (is_canceled(job.id) && !is_stopping() && cancel_elsewhere) (void)cancel_elsewhere(job.id).has_value();
    return;
  }
  job.finished = clock.now();
  if (result) {
    job.state = JobState::succeeded;
    job.fraction = 1;
    job.detail = result.value().detail;
    job.result_href = result.value().result_href;
  } else if (result.error().code == Errc::canceled && !is_stopping()) {
    job.state = JobState::canceled;
  } else if (result.error().code == Errc::canceled) {
    job.state = JobState::failed;
    job.problem = {problem_json(
        503, "internal", "interrupted: the server was stopped while the job was running; start it again")};
  } else {
    job.state = JobState::failed;
    job.problem = {problem_of(result.error()).body};
  }
  save(job);
}

}  // namespace anchord::api
