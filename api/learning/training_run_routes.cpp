#include <charconv>
#include <nlohmann/json.hpp>

#include "api/admin/job_answer.hpp"
#include "api/admin/job_json.hpp"
#include "api/admin/job_service.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/learning/learning_json.hpp"
#include "api/learning/routes.hpp"
#include "api/learning/training_request.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

Ordered run_json(LearningApi& l, const TrainingRun& run, bool whole) {
  const auto dataset = value_or_problem(l.stores.datasets.dataset(run.dataset));
  const auto job = value_or_problem(l.job_store.job(JobId{run.id.uuid}));
  return training_run_json(run, dataset, job, whole);
}

Response list_training_runs(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "task"});
  const auto task = request.query_value("task");
  return id_page<TrainingRunId>(
      request,
      [&](std::size_t limit, const std::optional<TrainingRunId>& after) {
        return l.stores.runs.runs(limit, after, task);
      },
      [&](const auto& run) { return run_json(l, run, false); });
}

Response finished(LearningApi& l, const Job& job) {
  const auto run = value_or_problem(l.stores.runs.run(TrainingRunId{job.id.uuid}));
  Response response = json_response(201, run_json(l, run, true));
  response.header("Location", "/api/v1/training-runs/" + to_string(run.id));
  return response;
}

Response create_training_run(LearningApi& l, const Request& request) {
  check_query(request, {});
  const auto body = json_body(request);
  std::vector<FieldError> errors;
  const auto wanted = read_training_request(body, errors);
  std::optional<DatasetRecord> dataset;
  if (!body.is_object() || !body.contains("dataset") || !body["dataset"].is_string()) {
    errors.push_back({"/dataset", "required", "the id or the name of a data set"});
  } else {
    const auto text = body["dataset"].get<std::string>();
    const auto id = parse_uuid(text);
    auto found = id ? l.stores.datasets.dataset(DatasetId{id.value()})
                    : l.stores.datasets.dataset(std::string_view(text));
    if (found)
      dataset = std::move(found).value();
    else if (found.error().code == Errc::not_found)
      errors.push_back({"/dataset", "unknown_dataset", "there is no such data set"});
    else
      value_or_problem(std::move(found));
  }
  if (dataset && errors.empty()) {
    if (const auto fits = wanted.spec.check_size(dataset->n_train); !fits)
      errors.push_back({"/grid", "too_much", fits.error().message});
  }
  refuse_if_any(errors);
  auto request_body = body;
  request_body["dataset"] = to_string(dataset->id);
  Job job = value_or_problem(l.training.submit(dataset->id, std::string(ml::task_name(wanted.spec.task)),
                                               to_wire(request_body), request.principal.name));
  l.audit(request, "training.start " + to_string(job.id));
  return job_outcome(l.jobs, request, std::move(job), [&](const Job& done) { return finished(l, done); });
}

Response restart_training_run(LearningApi& l, const Request& request) {
  check_query(request, {});
  auto job = l.training.restart(path_id<TrainingRunId>(request));
  if (!job && job.error().code == Errc::conflict) throw_problem(422, "state", job.error().message);
  Job again = value_or_problem(std::move(job));
  l.audit(request, "training.restart " + to_string(again.id));
  return job_outcome(l.jobs, request, std::move(again), [&](const Job& done) { return finished(l, done); });
}

Response remove_training_run(LearningApi& l, const Request& request) {
  const auto id = path_id<TrainingRunId>(request);
  const auto run = value_or_problem(l.stores.runs.run(id));
  const auto job = value_or_problem(l.job_store.job(JobId{id.uuid}));
  if (job.state == JobState::queued || job.state == JobState::running)
    throw_problem(422, "state", "the run has not ended; cancel its job first");
  value_or_problem(l.stores.runs.remove(run.id));
  l.audit(request, "training.delete " + to_string(id));
  Response response;
  response.status = 204;
  return response;
}

/// A part of the results as it was stored.
Response part(LearningApi& l, const Request& request, const std::string& name) {
  check_query(request, {});
  const auto id = path_id<TrainingRunId>(request);
  value_or_problem(l.stores.runs.run(id));
  Response response;
  response.header("Content-Type", "application/json");
  response.body = value_or_problem(l.stores.runs.part(id, name));
  return response;
}

Response predictions(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "split"});
  const auto id = path_id<TrainingRunId>(request);
  value_or_problem(l.stores.runs.run(id));
  const auto all = Ordered::parse(value_or_problem(l.stores.runs.part(id, "predictions")));
  const auto page = page_query(request, 10'000);
  const auto split = request.query_value("split");
  std::size_t i = 0;
  std::from_chars(page.cursor.data(), page.cursor.data() + page.cursor.size(), i);
  Ordered items = Ordered::array();
  for (; i < all.size() && items.size() < page.limit; ++i) {
    if (!split || all[i].value("split", "") == *split) items.push_back(all[i]);
  }
  return list_response(request, std::move(items), i < all.size() ? std::to_string(i) : "");
}

}  // namespace

void add_training_run_routes(Router& router, LearningApi& l) {
  const auto on = [&l](auto function) {
    return [&l, function](const Request& request) { return function(l, request); };
  };
  const auto engineer = Access::any_of({Role::engineer});
  const std::string base = "/api/v1/training-runs";
  router.add({Method::get, base, readers(), on(list_training_runs)});
  router.add({Method::post, base, engineer, on(create_training_run)});
  router.add({Method::get, base + "/{id}", readers(), [&l](const Request& request) {
                check_query(request, {});
                return json_response(
                    200,
                    run_json(l, value_or_problem(l.stores.runs.run(path_id<TrainingRunId>(request))), true));
              }});
  router.add({Method::del, base + "/{id}", engineer, on(remove_training_run)});
  router.add({Method::post, base + "/{id}/restart", engineer, on(restart_training_run)});
  for (const char* name : {"folds", "grid", "importance", "selection", "confusion", "roc", "cdf"}) {
    router.add(as_heavy({Method::get, base + "/{id}/" + name, readers(),
                         [&l, name](const Request& request) { return part(l, request, name); }}));
  }
  router.add(as_heavy({Method::get, base + "/{id}/predictions", readers(), on(predictions)}));
}

}  // namespace anchord::api
