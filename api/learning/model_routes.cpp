#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/learning/kept_data.hpp"
#include "api/learning/learning_json.hpp"
#include "api/learning/model_artifact.hpp"
#include "api/learning/model_gate.hpp"
#include "api/learning/model_signer.hpp"
#include "api/learning/promotion_events.hpp"
#include "api/learning/range_features.hpp"
#include "api/learning/routes.hpp"
#include "core/base/sha256.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;
using Json = nlohmann::json;

namespace {

constexpr std::size_t k_most_samples = 10'000;

/// Who is promoted, as the store has it: what a decision is made on, and what it is tied to.
struct Standing {
  std::uint64_t newest{};  ///< number of the newest promotion of any task; 0: none
  std::map<std::string, ModelId> models{};

  bool has(const StoredModel& model) const {
    const auto at = models.find(model.task);
    return at != models.end() && at->second == model.id;
  }
};

std::string etag_of(std::uint64_t newest) { return "\"m-" + std::to_string(newest) + '"'; }

Standing standing(LearningApi& l) {
  Standing out;
  for (const auto& one : value_or_problem(l.stores.models.active())) {
    out.newest = std::max(out.newest, one.number);
    if (one.model) out.models[one.task] = *one.model;
  }
  if (l.models.active()->newest < out.newest) value_or_problem(l.models.reload());
  return out;
}

/// If-Match of GET /models/active is optional; the store holds every decision to the state it was made on.
Standing standing_for(LearningApi& l, const Request& request) {
  auto now = standing(l);
  if (!request.header("if-match").empty()) require_match(request, etag_of(now.newest));
  return now;
}

bool is_active(LearningApi& l, const StoredModel& model) {
  const auto active = l.models.active();
  const auto at = active->models.find(model.task);
  return at != active->models.end() && at->second == model.id;
}

Response list(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "task"});
  const auto page = page_query(request);
  const auto task = request.query_value("task");
  auto rows = value_or_problem(l.stores.models.models(page.limit + 1, cursor_id<ModelId>(page.cursor)));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& model : rows)
    if (!task || model.task == *task) items.push_back(model_json(model, is_active(l, model)));
  return list_response(request, std::move(items), more ? to_string(rows.back().id) : "");
}

/// Keeps the signature of one that this server signed.
ModelStanding standing_of_upload(LearningApi& l, const std::string& artifact, const std::string& signature,
                                 std::string& kept) {
  if (signature.empty()) return ModelStanding::foreign;
  const auto standing = l.models.source().signer().standing(artifact, signature);
  if (standing == ModelStanding::changed)
    throw_problem(
        422, "validation", "the artifact was changed after this server signed it",
        {{"/signature", "edited",
          "does not match the content: send the artifact as it was exported, or without the signature"}});
  if (standing != ModelStanding::foreign) kept = signature;
  return standing;
}

/// An artifact from elsewhere. Everything about it is checked before it is kept.
Response upload(LearningApi& l, const Request& request) {
  check_query(request, {});
  auto read = read_model_artifact(text_body(request));
  if (!read)
    throw_problem(422, "validation", read.error().message, {{"", "bad_model", read.error().message}});
  const auto& model = read.value();
  // What is kept is what we understood, not what was sent.
  const std::string artifact = value_or_problem(checked_model_artifact(model));
  StoredModel stored;
  stored.task = ml::task_name(model.info.task);
  stored.method = model.info.method;
  stored.manifest = {manifest_of(artifact)};
  Sha256 sum;
  sum.add(std::string_view(artifact));
  stored.sha256_hex = sum.hex();
  stored.created = l.clock.now();
  stored.id.uuid = make_uuid_v7(stored.created);
  stored.created_by = request.principal.name;
  // One that left this server comes back as what it was, if not a number of it is another.
  const auto standing = standing_of_upload(l, artifact, signature_in(request.body), stored.signature);
  value_or_problem(l.stores.models.insert(stored, artifact));
  l.audit(request, "model.upload " + to_string(stored.id) + " " + stored.sha256_hex + " " +
                       std::string(to_string(standing)));
  Ordered body = model_json(stored, false);
  body["standing"] = to_string(standing);
  Response response = json_response(201, body);
  response.header("Location", "/api/v1/models/" + to_string(stored.id));
  return response;
}

/// What is stored, and whether it may be used: one that was edited is told as such, not hidden.
Response one_model(LearningApi& l, const Request& request) {
  const auto model = value_or_problem(l.stores.models.model(path_id<ModelId>(request)));
  const auto found = l.models.source().artifact(model.id);
  Ordered body = model_json(model, is_active(l, model));
  body["standing"] = to_string(found ? found.value().standing : ModelStanding::changed);
  return json_response(200, body);
}

Response artifact(LearningApi& l, const Request& request) {
  check_query(request, {});
  const auto found = value_or_problem(l.models.source().artifact(path_id<ModelId>(request)));
  const auto& model = found.stored;
  Response response;
  response.header("Content-Type", "application/json");
  response.header("ETag", "\"" + model.sha256_hex + "-" + std::string(to_string(found.standing)) + "\"");
  response.header("Content-Disposition",
                  "attachment; filename=\"" + model.task + "-" + model.sha256_hex.substr(0, 12) + ".json\"");
  response.body = exported_artifact(found.text, model.signature);
  return response;
}

Ordered active_json(LearningApi& l, const std::shared_ptr<const ModelRegistry::Active>& active) {
  Ordered models = Ordered::object();
  for (const char* task : {"nlos_id", "los_bias", "nlos_bias", "bias"}) {
    const auto at = active->models.find(task);
    models[task] = at == active->models.end()
                       ? Ordered(nullptr)
                       : model_json(value_or_problem(l.stores.models.model(at->second)), true);
  }
  const bool raw = active->predictor.empty();
  // As ml::Predictor takes them.
  const bool two_classes = active->models.contains("nlos_id") && active->models.contains("los_bias") &&
                           active->models.contains("nlos_bias");
  return {{"models", std::move(models)},
          {"correction", ml::k_correction_words.word(active->correction)},
          {"raw", raw},
          {"note", !active->fault.empty() ? Ordered(active->fault)
                   : raw                  ? Ordered("no model is promoted: ranges are used uncorrected")
                   : two_classes && active->models.contains("bias")
                       ? Ordered("the model of bias is not used: nlos_id, los_bias and nlos_bias together "
                                 "take its place")
                       : Ordered(nullptr)}};
}

Response active_answer(LearningApi& l) {
  (void)standing(l);
  const auto active = l.models.active();  // of one moment: its ETag is that of another state otherwise
  Response response = json_response(200, active_json(l, active));
  response.header("ETag", etag_of(active->newest));
  return response;
}

/// Audited before it happens, as publications are; what the store then refuses is audited as refused.
Promotion promoted(LearningApi& l, const Request& request, const std::string& what,
                   const Promotion& promotion, const Standing& decided_on) {
  l.audit(request, what);
  auto done = l.stores.models.promote(promotion, decided_on.newest);
  if (!done) l.audit(request, what, "refused: " + done.error().message);
  return value_or_problem(std::move(done));
}

void announce(LearningApi& l, const Promotion& done, const std::string& method) {
  value_or_problem(l.models.reload());
  const auto words = promotion_words(done, method);
  l.events.add(EventLevel::info, words.code, words.text);
  if (done.task != k_correction_task) l.note_in_flights(words.code, words.text);
}

Response patch_active(LearningApi& l, const Request& request) {
  check_query(request, {});
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto correction = fields.word("correction", ml::k_correction_words, true);
  fields.finish();
  refuse_if_any(errors);
  const auto how = *correction;
  const auto before = standing_for(l, request);
  const auto done = promoted(l, request, "models.correction " + std::string(ml::k_correction_words.word(how)),
                             {0, std::string(k_correction_task), std::nullopt, request.principal.name,
                              std::string(ml::k_correction_words.word(how)), l.clock.now(), false},
                             before);
  announce(l, done, "");
  return active_answer(l);
}

struct ActiveModel {
  ml::Model model;
  ModelStanding standing{};
};

std::optional<ActiveModel> active_model(LearningApi& l, const Standing& now, const std::string& task) {
  const auto at = now.models.find(task);
  if (at == now.models.end()) return std::nullopt;
  const auto artifact = l.models.source().artifact(at->second);
  if (!artifact) return std::nullopt;  // it was edited: it is not in use, and nothing is measured against it
  auto model = read_model_artifact(artifact.value().text);
  if (!model) return std::nullopt;
  return ActiveModel{std::move(model).value(), artifact.value().standing};
}

/// Made here: by the places its own run held out, else by what this server keeps, else its own figures. From
/// elsewhere: by what this server keeps. Either on the places of the active model too.
GateReport gate_report(LearningApi& l, const Standing& now, const ModelSource::Artifact& candidate) {
  const auto model = value_or_problem(read_model_artifact(candidate.text));
  const auto current = active_model(l, now, candidate.stored.task);
  GateData data;
  const auto in_use = l.models.active();
  data.beside = in_use->predictor.models();
  data.correction = in_use->correction;
  data.believe_manifest = candidate.standing == ModelStanding::made;
  DatasetTable own;
  if (data.believe_manifest && candidate.stored.run) {
    const auto run = value_or_problem(l.stores.runs.run(*candidate.stored.run));
    if (auto parsed = DatasetTable::parse(value_or_problem(l.stores.datasets.csv(run.dataset)))) {
      own = std::move(parsed).value();
      data.rows.push_back({&own, "held_out", k_least_kept_rows});
      data.own = &own;
    }
  }
  const ml::Model* active = current ? &current->model : nullptr;
  std::optional<DatasetTable> places;
  // On the same data both were compared above, if the manifest that says so can be believed.
  const bool same_data =
      data.believe_manifest && active != nullptr && active->info.data_digest == model.info.data_digest;
  if (active != nullptr && !same_data) {
    places = value_or_problem(table_of_digest(l.stores.datasets, active->info.data_digest));
    data.active = {true, places ? &*places : nullptr, current->standing == ModelStanding::made};
  }
  auto report = gate_of(model, active, data);
  const bool measured =
      std::ranges::any_of(report.checks, [](const GateCheck& check) { return check.basis == "held_out"; });
  if (!measured) {  // reading all that is kept takes a while
    std::vector<std::string> learned{model.info.data_digest};
    if (active != nullptr) learned.push_back(active->info.data_digest);
    const auto kept = value_or_problem(kept_data(l.stores.datasets, learned)).table;
    data.rows.push_back({&kept, "kept_data", k_least_kept_rows});
    report = gate_of(model, active, data);
  }
  report.standing = to_string(candidate.standing);
  return report;
}

/// By itself. A store that is away is no fault of the model: the request may be sent again.
ModelRegistry::Active usable(LearningApi& l, const StoredModel& stored) {
  auto loaded = load_models(l.models.source(), {{stored.task, stored.id}}, ml::Correction::weighted, false);
  if (!loaded && loaded.error().code != Errc::storage_unavailable)
    throw_problem(422, "unsupported", loaded.error().message);
  return value_or_problem(std::move(loaded));
}

Response promote(LearningApi& l, const Request& request) {
  check_query(request, {});
  const auto candidate = value_or_problem(l.models.source().artifact(path_id<ModelId>(request)));
  const auto& stored = candidate.stored;
  const auto reason = optional_reason(request);
  const auto before = standing_for(l, request);
  if (before.has(stored)) throw_problem(422, "state", "the model is already active");
  const auto model = value_or_problem(read_model_artifact(candidate.text));
  if (const auto lacking = lacking_in_flight(model); !lacking.empty())
    throw_problem(422, "unsupported",
                  "no range of a flight can feed the model: none has " + lacking +
                      "; train without it, or use the model only with predict and evaluate");
  // One that live ranges cannot be judged by would ground the others with it.
  (void)usable(l, stored);
  const auto gate = gate_report(l, before, candidate);
  if (!gate.passed && reason.empty())
    throw_problem(422, "state", gate.why + " (give a reason to promote it anyway)");
  const auto done = promoted(l, request,
                             "model.promote " + to_string(stored.id) +
                                 (gate.passed ? "" : " against the gate: " + gate.why) +
                                 (reason.empty() ? "" : " reason: " + reason),
                             {0, stored.task, stored.id, request.principal.name, reason, l.clock.now(), false,
                              candidate.standing == ModelStanding::made
                                  ? std::string{}
                                  : l.models.source().signer().sign(ModelStanding::vouched, candidate.text)},
                             before);
  if (!gate.passed)
    l.events.add(EventLevel::warning, "model.override",
                 request.principal.name + " promoted model " + to_string(stored.id) + " against the gate (" +
                     gate.why + "): " + reason);
  announce(l, done, stored.method);
  Ordered answer = promotion_json(done);
  answer["gate"] = gate_json(gate);
  return json_response(200, answer);
}

Response gate_of_model(LearningApi& l, const Request& request) {
  check_query(request, {});
  const auto candidate = value_or_problem(l.models.source().artifact(path_id<ModelId>(request)));
  return json_response(200, gate_json(gate_report(l, standing(l), candidate)));
}

/// What was active before the newest promotion that still stands.
std::optional<ModelId> before_the_newest(const std::vector<Promotion>& newest_first) {
  std::vector<ModelId> stack;
  for (auto it = newest_first.rbegin(); it != newest_first.rend(); ++it) {
    if (it->rollback) {
      if (!stack.empty()) stack.pop_back();
    } else if (it->model) {
      stack.push_back(*it->model);
    }
  }
  if (stack.empty()) throw_problem(422, "state", "no model of this task is active");
  stack.pop_back();
  if (stack.empty()) return std::nullopt;
  return stack.back();
}

Response roll_back(LearningApi& l, const Request& request) {
  check_query(request, {});
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto task = fields.word("task", ml::k_task_words, true);
  const auto reason = fields.text("reason", 500).value_or("");
  fields.finish();
  refuse_if_any(errors);
  const std::string name(ml::task_name(*task));
  const auto before = standing_for(l, request);
  const auto back = before_the_newest(value_or_problem(l.stores.models.promotions(name, 100'000)));
  const auto done =
      promoted(l, request, "model.rollback " + name + (reason.empty() ? "" : " reason: " + reason),
               {0, name, back, request.principal.name, reason, l.clock.now(), true}, before);
  announce(l, done, "");
  return json_response(200, promotion_json(done));
}

Response promotions(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "fields", "task"});
  const auto page = page_query(request);
  Ordered items = Ordered::array();
  for (const auto& one :
       value_or_problem(l.stores.models.promotions(request.query_value("task").value_or(""), page.limit)))
    items.push_back(promotion_json(one));
  return list_response(request, std::move(items), "");
}

Response predict(LearningApi& l, const Request& request) {
  check_query(request, {});
  const auto body = json_body(request);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  const Json* one = fields.child("sample");
  const Json* many = fields.child("samples");
  const auto correction = fields.word("correction", ml::k_correction_words);
  fields.finish();
  if ((one == nullptr) == (many == nullptr))
    errors.push_back({"/samples", "required", "send either sample or samples"});
  else if (many != nullptr && (!many->is_array() || many->empty() || many->size() > k_most_samples))
    errors.push_back({"/samples", "wrong_type", "must be an array of 1 to 10000 samples"});
  refuse_if_any(errors);
  std::vector<nlos::FeatureVector> features;
  if (one != nullptr) features.push_back(read_features(*one, "/sample", errors));
  for (std::size_t i = 0; many != nullptr && i < many->size() && errors.size() < 100; ++i)
    features.push_back(read_features((*many)[i], "/samples/" + std::to_string(i), errors));
  refuse_if_any(errors);

  std::shared_ptr<const ModelRegistry::Active> models = l.models.active();
  if (request.params.at("id") != "active") {
    const auto stored = value_or_problem(l.stores.models.model(path_id<ModelId>(request)));
    models = std::make_shared<const ModelRegistry::Active>(usable(l, stored));
  }
  auto chosen = *models;
  chosen.correction = correction.value_or(chosen.correction);
  Ordered items = Ordered::array();
  for (const auto& one_sample : features)
    items.push_back(model_answer_json(ModelRegistry::predict(chosen, one_sample)));
  if (one != nullptr) return json_response(200, items.front());
  return json_response(200, {{"items", std::move(items)}});
}

}  // namespace

void add_model_routes(Router& router, LearningApi& l) {
  const auto on = [&l](auto function) {
    return [&l, function](const Request& request) { return function(l, request); };
  };
  const auto engineer = Access::any_of({Role::engineer});
  router.add({Method::get, "/api/v1/models", readers(), on(list)});
  router.add(as_heavy({Method::post, "/api/v1/models", engineer, on(upload), k_max_artifact_bytes}));
  router.add({Method::get, "/api/v1/models/active", readers(), [&l](const Request& request) {
                check_query(request, {});
                return active_answer(l);
              }});
  router.add({Method::patch, "/api/v1/models/active", engineer, on(patch_active)});
  router.add({Method::get, "/api/v1/models/promotions", readers(), on(promotions)});
  router.add({Method::post, "/api/v1/models/rollback", engineer, on(roll_back)});
  router.add({Method::get, "/api/v1/models/{id}", readers(), [&l](const Request& request) {
                check_query(request, {});
                return one_model(l, request);
              }});
  router.add({Method::del, "/api/v1/models/{id}", engineer, [&l](const Request& request) {
                const auto id = path_id<ModelId>(request);
                value_or_problem(l.stores.models.remove(id));
                l.audit(request, "model.delete " + to_string(id));
                Response response;
                response.status = 204;
                return response;
              }});
  router.add(as_heavy({Method::get, "/api/v1/models/{id}/artifact", readers(), on(artifact)}));
  router.add(as_heavy({Method::get, "/api/v1/models/{id}/gate", readers(), on(gate_of_model)}));
  router.add(as_heavy({Method::post, "/api/v1/models/{id}/promote", engineer, on(promote)}));
  router.add(keeps_nothing(as_heavy({Method::post, "/api/v1/models/{id}/predict", readers(), on(predict)})));
}

}  // namespace anchord::api
