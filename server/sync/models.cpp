// Models that no calibration brought along: the same artifact is the same model, whatever its id. And those
// that are active at the centre, for the field.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/to_wire.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

/// Of an artifact (api/learning: k_max_artifact_bytes), with a signature.
constexpr std::uint64_t k_most_model_bytes = std::uint64_t{65} << 20;

bool is_sha256(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

std::string name_of(const Json& model) {
  return "model " + text_of(model, "task") + " " + text_of(model, "method") + " " +
         text_of(model, "sha256").substr(0, 12);
}

/// Why it did not go; empty: it did.
Result<std::string> send_model(Run& run, const Json& model) {
  const std::string sha256 = text_of(model, "sha256");
  BOOST_OUTCOME_TRY(const auto artifact,
                    run.source().call({.method = "GET",
                                       .target = path_of("models", text_of(model, "id"), "/artifact"),
                                       .most_bytes = k_most_model_bytes}));
  if (artifact.status != 200) return sync::in_words(artifact);
  PeerRequest upload{"POST", "/api/v1/models", artifact.body};
  upload.headers.emplace("Idempotency-Key", "sync-" + sha256);
  BOOST_OUTCOME_TRY(const auto answer, run.target().call(upload));
  if (answer.status != 201) return sync::in_words(answer);
  const auto stored = json_of(answer);
  if (text_of(stored, "sha256") == sha256) return std::string();
  BOOST_OUTCOME_TRYV(run.target().call({"DELETE", path_of("models", text_of(stored, "id"))}));
  return "the artifact is another one than the list of " + run.source().url() + " has: not stored";
}

/// Shows what is active at the centre; makes it so here where that was asked for, by the field's own gate.
Result<void> activate(Run& run, const std::string& task, const Json& active, const Json& here) {
  const std::string name = name_of(active) + ", active at the centre: ";
  if (text_of(member(here, task.c_str()), "sha256") == text_of(active, "sha256")) {
    run.report(name + "active here too");
    return boost::outcome_v2::success();
  }
  if (!run.options.activate_models || run.options.dry_run) {
    run.report(name + (run.options.activate_models ? "would be made active here, if the gate passes it"
                                                   : "not active here (--activate-models)"));
    return boost::outcome_v2::success();
  }
  BOOST_OUTCOME_TRY(const auto models, run.field.list("/api/v1/models?fields=id,sha256"));
  const auto at = std::ranges::find_if(
      models, [&](const Json& model) { return text_of(model, "sha256") == text_of(active, "sha256"); });
  if (at == models.end()) {
    run.failed(name + "not active here, since it did not come");
    return boost::outcome_v2::success();
  }
  const std::string body =
      run.options.reason.empty() ? std::string("{}") : to_wire(Json{{"reason", run.options.reason}});
  BOOST_OUTCOME_TRY(const auto answer,
                    run.field.call({.method = "POST",
                                    .target = path_of("models", text_of(*at, "id"), "/promote"),
                                    .body = body,
                                    .bundle = true}));
  if (answer.status == 200)
    run.report(name + "active here from now on");
  else
    run.failed(name + "not active here: " + sync::in_words(answer));
  return boost::outcome_v2::success();
}

}  // namespace

Result<void> send_models(Run& run) {
  if (!run.whole_servers) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(const auto models, run.source().list("/api/v1/models?fields=id,task,method,sha256"));
  BOOST_OUTCOME_TRY(const auto known, run.target().list("/api/v1/models?fields=sha256"));
  std::set<std::string> there;
  for (const auto& model : known) there.insert(text_of(model, "sha256"));
  for (const auto& model : models) {
    if (!is_sha256(text_of(model, "sha256")))
      return run.source().stranger("/api/v1/models", "a model of the list has no SHA-256");
    const std::string name = name_of(model);
    if (!there.insert(text_of(model, "sha256")).second) {
      ++run.outcome.models_there;
      continue;
    }
    if (run.options.dry_run) {
      run.report(name + (run.up() ? ": would send" : ": would be taken"));
      continue;
    }
    BOOST_OUTCOME_TRY(const auto failure, send_model(run, model));
    if (failure.empty()) {
      ++run.outcome.models_sent;
      run.report(name + ": stored, not active");
    } else {
      run.failed(name + ": " + failure);
    }
  }
  if (run.up()) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(const auto active, run.centre.get("/api/v1/models/active"));
  BOOST_OUTCOME_TRY(const auto here, run.field.get("/api/v1/models/active"));
  const Json& of_tasks = member(active, "models");
  if (!of_tasks.is_object()) return boost::outcome_v2::success();
  for (const auto& [task, model] : of_tasks.items()) {
    if (!model.is_object()) continue;
    BOOST_OUTCOME_TRYV(activate(run, task, model, member(here, "models")));
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::sync
