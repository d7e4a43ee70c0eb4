#include "api/learning/training_service.hpp"

#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/admin/job_service.hpp"
#include "api/learning/model_artifact.hpp"
#include "api/learning/model_signer.hpp"
#include "api/work/work_desk.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

}  // namespace

std::string manifest_of(const std::string& artifact) {
  const auto json = Json::parse(artifact, nullptr, false);
  return json.is_object() && json.contains("manifest") ? to_wire(json["manifest"]) : "{}";
}

TrainingService::TrainingService(Deps deps) : deps_(std::move(deps)) {
  if (deps_.desk == nullptr) return;
  deps_.desk->add("training",
                  {.message = [this](const JobId& id) -> Result<std::string> {
                     BOOST_OUTCOME_TRY(const auto run, deps_.runs.run(TrainingRunId{id.uuid}));
                     return message_of(run);
                   },
                   .take_in = [this](const Job& job, const std::string& answer) -> Result<JobEnd> {
                     BOOST_OUTCOME_TRY(const auto run, deps_.runs.run(TrainingRunId{job.id.uuid}));
                     return take_in(run, answer);
                   }});
}

Result<std::string> TrainingService::message_of(const TrainingRun& run) const {
  BOOST_OUTCOME_TRY(const auto csv, deps_.datasets.csv(run.dataset));
  return to_wire(Json{{"kind", "training"},
                      {"csv", csv},
                      {"request", Json::parse(run.request.text)},
                      {"code_version", deps_.code_version}});
}

std::function<Result<JobEnd>(JobContext&)> TrainingService::work_of(const TrainingRun& run) {
  return [this, run](JobContext& job) -> Result<JobEnd> {
    BOOST_OUTCOME_TRY(const auto message, message_of(run));
    BOOST_OUTCOME_TRY(
        const auto answer,
        deps_.run_work(
            message, [&job](const WorkProgress& p) { job.progress(0.98 * p.fraction, p.stage, p.detail); },
            [&job] { return job.canceled(); }));
    if (job.canceled()) return make_error(Errc::canceled, "canceled");
    job.progress(0.98, "store", "");
    return take_in(run, answer);
  };
}

Result<JobEnd> TrainingService::take_in(const TrainingRun& run, const std::string& answer) {
  const std::string href = "/api/v1/training-runs/" + to_string(run.id);
  if (run.model) return JobEnd{href, ""};
  const auto json = Json::parse(answer, nullptr, false);
  if (!json.is_object() || !json.contains("artifact") || !json.contains("parts"))
    return make_error(Errc::internal, "the answer of the worker process cannot be read");
  const auto artifact = json["artifact"].get<std::string>();
  // What a worker made is read like what a stranger sends: the server never trusts bytes it will fly with.
  BOOST_OUTCOME_TRY(const auto model, read_model_artifact(artifact));
  StoredModel stored;
  stored.created = deps_.clock.now();
  stored.id.uuid = make_uuid_v7(stored.created);
  stored.task = ml::task_name(model.info.task);
  stored.method = model.info.method;
  stored.run = run.id;
  stored.created_by = run.created_by;
  stored.manifest = {manifest_of(artifact)};
  Sha256 sum;
  sum.add(artifact);
  stored.sha256_hex = sum.hex();
  stored.signature = deps_.signer.sign(ModelStanding::made, artifact);
  std::map<std::string, std::string> parts;
  for (const auto& [name, text] : json["parts"].items()) parts[name] = text.get<std::string>();
  BOOST_OUTCOME_TRYV(
      deps_.runs.finish(run.id, {json["summary"].get_ref<const std::string&>()}, parts, stored, artifact));
  deps_.events.add(EventLevel::info, "model.trained",
                   stored.method + " for " + stored.task + " is trained: model " + to_string(stored.id));
  return JobEnd{href, stored.method};
}

Result<Job> TrainingService::submit(const DatasetId& dataset, std::string task, std::string request_json,
                                    std::string by) {
  TrainingRun run;
  run.created = deps_.clock.now();
  run.id.uuid = make_uuid_v7(run.created);
  run.dataset = dataset;
  run.task = std::move(task);
  run.request = {std::move(request_json)};
  run.created_by = std::move(by);
  BOOST_OUTCOME_TRYV(deps_.runs.insert(run));
  const auto begin = [&]() -> Result<Job> {
    const JobId id{run.id.uuid};
    if (deps_.desk == nullptr) return deps_.jobs.submit("training", run.request.text, work_of(run), id);
    BOOST_OUTCOME_TRY(auto message, message_of(run));
    return deps_.desk->submit("training", run.request.text, std::move(message), id);
  };
  auto job = begin();
  if (!job) (void)deps_.runs.remove(run.id).has_value();
  return job;
}

Result<Job> TrainingService::restart(const TrainingRunId& id) {
  BOOST_OUTCOME_TRY(const auto run, deps_.runs.run(id));
  if (deps_.desk == nullptr) return deps_.jobs.restart(JobId{id.uuid}, work_of(run));
  BOOST_OUTCOME_TRY(auto message, message_of(run));
  return deps_.desk->restart(JobId{id.uuid}, std::move(message));
}

}  // namespace anchord::api
