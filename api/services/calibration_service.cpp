#include "api/services/calibration_service.hpp"

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "api/json/reader.hpp"
#include "api/json/wire_resources.hpp"
#include "api/live/hub.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/fuse.hpp"

namespace anchord::api {

using Json = nlohmann::json;

CalibrationRequest read_calibration_request(const Json& body, std::vector<FieldError>& errors) {
  CalibrationRequest out;
  Fields fields(body, "", errors);
  std::set<std::string> seen;
  const auto read_ids = [&](const char* key, std::vector<MissionId>& ids) {
    const Json* list = fields.child(key);
    if (list == nullptr) return;
    if (!list->is_array() || list->empty() || list->size() > 100)
      return fields.error(key, "wrong_type", "must be an array of 1 to 100 mission ids");
    for (std::size_t i = 0; i < list->size(); ++i) {
      const auto& item = (*list)[i];
      const auto id = parse_uuid(item.is_string() ? item.get_ref<const std::string&>() : "");
      const std::string at = std::string("/") + key + '/' + std::to_string(i);
      if (!id)
        errors.push_back({at, "bad_id", id.error().message});
      else if (!seen.insert(to_string(id.value())).second)
        errors.push_back({at, "duplicate", "the mission stands twice"});
      else
        ids.push_back(MissionId{id.value()});
    }
  };
  if (!fields.has("missions")) fields.error("missions", "required", "missions is missing");
  read_ids("missions", out.missions);
  read_ids("learn_from", out.learn_from);
  auto& options = out.options;
  if (const auto dims = fields.integer("dims", 2, 3)) options.dims = *dims == 2 ? Dims::two : Dims::three;
  if (const auto solver = fields.word("solver", {"gauss_newton", "levenberg_marquardt", "dogleg"}))
    options.method = static_cast<anchord::Method>(*solver);
  if (const auto weights = fields.word("weights", {"inverse_variance", "dissertation"}))
    options.weights = static_cast<Weights>(*weights);
  if (const Json* loss = fields.child("loss")) {
    Fields inner(*loss, "/loss", errors);
    if (const auto type = inner.word("type", {"none", "huber", "cauchy", "tukey"}, true))
      options.loss = static_cast<Loss>(*type);
    // The robust scale comes from the residuals themselves; `scale` stretches it, 1.5 being the neutral value
    // of api.md.
    if (const auto scale = inner.number("scale", 0.1, 10)) options.mad_factor *= *scale / 1.5;
    inner.finish();
  }
  if (const auto height = fields.number("anchor_height_m", -1000, 9000)) options.anchor_height_m = *height;
  if (const auto gap = fields.number("max_gap_s", 0.01, 10)) options.max_gap_s = *gap;
  if (const auto fix = fields.word("min_fix", {"none", "single", "dgps", "float", "fixed"}))
    options.min_fix = static_cast<FixClass>(*fix);
  for (const char* later :
       {"frame", "use_anchor_anchor", "models", "sigma_m", "initial", "compare_uncorrected"}) {
    if (fields.child(later) != nullptr)
      fields.error(later, "unsupported", std::string(later) + " cannot be set in this version");
  }
  fields.finish();
  out.settings_json = body.is_object() ? [&] {
    Json settings = body;
    settings.erase("missions");
    return settings.dump();
  }() : "{}";
  return out;
}

Result<FlightData> load_flight(MeasurementStore& store, const Mission& mission,
                               const std::function<bool()>& canceled) {
  FlightData flight;
  flight.mission = mission;
  MeasurementStore::Filter filter;
  filter.mission = mission.id;
  filter.limit = 10'000;
  do {
    if (canceled()) return make_error(Errc::canceled, "canceled");
    BOOST_OUTCOME_TRY(auto page, store.fixes(filter));
    for (auto& row : page.rows) flight.fixes.push_back(std::move(row));
    filter.after = page.next;
  } while (!filter.after.empty());
  do {
    if (canceled()) return make_error(Errc::canceled, "canceled");
    BOOST_OUTCOME_TRY(auto page, store.ranges(filter));
    for (auto& row : page.rows) flight.ranges.push_back(std::move(row));
    filter.after = page.next;
  } while (!filter.after.empty());
  return flight;
}

struct CalibrationService::State {
  explicit State(Deps d) : deps(d) {}
  struct Task {
    JobId id;
    CalibrationRequest request;
  };
  Deps deps;
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<Task> queue;
  std::set<JobId> canceled;
  bool stopping{false};
  std::thread thread;

  bool is_canceled(const JobId& id) {
    const std::scoped_lock lock(mutex);
    return stopping || canceled.count(id) > 0;
  }
  void save(const Job& job) {
    // A job that cannot be written is still shown live; after a restart it counts as interrupted.
    (void)deps.jobs.update(job).has_value();
    deps.hub.publish(Topic::jobs, job_json(job).dump(), deps.clock.now().us(), to_string(job.id));
    changed.notify_all();
  }
  void progress(Job& job, double fraction, std::string stage, std::string detail) {
    job.fraction = fraction;
    job.stage = std::move(stage);
    job.detail = std::move(detail);
    save(job);
  }
  void loop();
  void run(const Task& task);
  Result<Calibration> solve(const Task& task, Job& job);
};

CalibrationService::CalibrationService(Deps deps) : state_(std::make_shared<State>(deps)) {}
CalibrationService::~CalibrationService() { stop(); }

void CalibrationService::start() {
  const auto problem =
      problem_json(503, "internal", "interrupted: the server was restarted while the job ran; send it again");
  (void)state_->deps.jobs.fail_unfinished(state_->deps.clock.now(), problem).has_value();
  state_->thread = std::thread([state = state_] { state->loop(); });
}

void CalibrationService::stop() {
  {
    const std::scoped_lock lock(state_->mutex);
    state_->stopping = true;
  }
  state_->changed.notify_all();
  if (state_->thread.joinable()) state_->thread.join();
}

Result<Job> CalibrationService::submit(CalibrationRequest request) {
  for (const auto& id : request.missions) {
    BOOST_OUTCOME_TRY(state_->deps.missions.mission(id));
  }
  Job job;
  job.created = state_->deps.clock.now();
  job.id.uuid = make_uuid_v7(job.created);
  job.kind = "calibration";
  job.stage = "queued";
  job.request_json = request.settings_json;
  {
    const std::scoped_lock lock(state_->mutex);
    if (state_->stopping) return make_error(Errc::queue_full, "the server is stopping");
    if (state_->queue.size() >= k_max_queued)
      return make_error(Errc::queue_full, "16 jobs are waiting already");
  }
  BOOST_OUTCOME_TRY(state_->deps.jobs.insert(job));
  state_->deps.hub.publish(Topic::jobs, job_json(job).dump(), job.created.us(), to_string(job.id));
  {
    const std::scoped_lock lock(state_->mutex);
    state_->queue.push_back({job.id, std::move(request)});
  }
  state_->changed.notify_all();
  return job;
}

Result<Job> CalibrationService::wait(const JobId& id, std::chrono::milliseconds longest) {
  const auto deadline = std::chrono::steady_clock::now() + longest;
  while (true) {
    std::unique_lock lock(state_->mutex);
    BOOST_OUTCOME_TRY(auto job, state_->deps.jobs.job(id));
    const bool ended = job.state != JobState::queued && job.state != JobState::running;
    if (ended || state_->stopping || std::chrono::steady_clock::now() >= deadline) return job;
    // The change may be told between the read and the wait: look again after a while in any case.
    state_->changed.wait_until(
        lock, std::min(deadline, std::chrono::steady_clock::now() + std::chrono::milliseconds(100)));
  }
}

Result<Job> CalibrationService::cancel(const JobId& id) {
  BOOST_OUTCOME_TRY(auto job, state_->deps.jobs.job(id));
  if (job.state != JobState::queued && job.state != JobState::running)
    return make_error(Errc::conflict, "the job has ended");
  {
    const std::scoped_lock lock(state_->mutex);
    state_->canceled.insert(id);
  }
  state_->changed.notify_all();
  return wait(id, std::chrono::seconds(1));
}

void CalibrationService::State::loop() {
  while (true) {
    Task task;
    {
      std::unique_lock lock(mutex);
      changed.wait(lock, [&] { return stopping || !queue.empty(); });
      if (stopping) return;  // what waits is marked interrupted by the next start
      task = std::move(queue.front());
      queue.pop_front();
    }
    run(task);
    const std::scoped_lock lock(mutex);
    canceled.erase(task.id);
  }
}

void CalibrationService::State::run(const Task& task) {
  auto stored = deps.jobs.job(task.id);
  if (!stored) return;
  Job job = std::move(stored).value();
  job.state = JobState::running;
  job.started = deps.clock.now();
  progress(job, 0, "load", "");
  Result<Calibration> result = make_error(Errc::internal, "");
  try {  // the door of jobs: whatever is thrown ends this job alone
    result = solve(task, job);
    if (result) {
      auto kept = deps.anchors.insert(result.value());
      if (!kept) result = kept.error();
    }
  } catch (const std::exception& fault) {
    result = make_error(Errc::internal, fault.what());
  }
  job.finished = deps.clock.now();
  if (result) {
    job.state = JobState::succeeded;
    job.fraction = 1;
    job.detail = std::to_string(result.value().anchors.size()) + " anchors";
    job.result_href = "/api/v1/calibrations/" + to_string(result.value().id);
  } else if (result.error().code == Errc::canceled && !stopping) {
    job.state = JobState::canceled;
  } else {
    job.state = JobState::failed;
    job.problem_json = problem_of(result.error()).body;
  }
  save(job);
}

Result<Calibration> CalibrationService::State::solve(const Task& task, Job& job) {
  const auto canceled_now = [&] { return is_canceled(task.id); };
  std::vector<FlightData> flights;
  std::vector<MissionId> all = task.request.missions;
  all.insert(all.end(), task.request.learn_from.begin(), task.request.learn_from.end());
  for (const auto& id : all) {
    BOOST_OUTCOME_TRY(auto mission, deps.missions.mission(id));
    BOOST_OUTCOME_TRY(auto flight, load_flight(deps.measurements, mission, canceled_now));
    flights.push_back(std::move(flight));
    progress(job, 0.3 * static_cast<double>(flights.size()) / static_cast<double>(all.size()), "load",
             flights.back().mission.name);
  }
  FlightOptions options = task.request.options;
  options.canceled = canceled_now;
  Calibration out;
  out.frame = flights.front().mission.frame;
  for (const auto& flight : flights) {
    if (flight.mission.frame != out.frame)
      return make_error(Errc::invalid_argument,
                        "missions on the globe and in a local frame cannot be solved together");
    if (out.frame != TrackFrame::wgs84 || options.origin) continue;
    for (const auto& fix :
         flight.fixes) {  // one frame for all flights, so that their answers can be compared
      if (fix.fix >= options.min_fix && fix.frame == TrackFrame::wgs84) {
        options.origin = fix.position;
        break;
      }
    }
  }
  progress(job, 0.3, "solve", std::to_string(flights.size()) + " flights");
  std::vector<const FlightData*> pointers;
  for (const auto& flight : flights) pointers.push_back(&flight);
  BOOST_OUTCOME_TRY(auto solutions, solve_flights(pointers, options));
  if (canceled_now()) return make_error(Errc::canceled, "canceled");
  out.origin = out.frame == TrackFrame::wgs84 ? options.origin : std::nullopt;

  std::map<NetworkId, std::vector<Estimate>> by_anchor;
  for (std::size_t i = 0; i < task.request.missions.size(); ++i) {
    const auto& solution = solutions[i];
    for (const auto& anchor : solution.anchors) by_anchor[anchor.estimate.anchor].push_back(anchor.estimate);
  }
  for (const auto& [id, estimates] : by_anchor) {
    Estimate estimate = fuse_estimates(estimates);
    if (out.origin) {
      const EnuFrame frame(*out.origin);
      if (estimate.best) estimate.best->wgs84 = frame.wgs84_from_enu(estimate.best->position);
      if (estimate.mirror) estimate.mirror->wgs84 = frame.wgs84_from_enu(estimate.mirror->position);
    }
    out.anchors.push_back(std::move(estimate));
  }
  out.created = deps.clock.now();
  out.id.uuid = task.id.uuid;  // the job and what it makes share their number
  out.missions = task.request.missions;
  out.settings_json = task.request.settings_json;
  progress(job, 0.95, "store", "");
  return out;
}

}  // namespace anchord::api
