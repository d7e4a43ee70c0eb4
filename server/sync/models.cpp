// Models that no calibration brought along: the same artifact is the same model, whatever its id.
#include <nlohmann/json.hpp>
#include <set>

#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {

Result<void> send_models(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome) {
  BOOST_OUTCOME_TRY(const auto models, field.list("/api/v1/models?fields=id,task,method,sha256"));
  BOOST_OUTCOME_TRY(const auto known, centre.list("/api/v1/models?fields=sha256"));
  std::set<std::string> there;
  for (const auto& model : known) there.insert(text_of(model, "sha256"));
  for (const auto& model : models) {
    const std::string sha256 = text_of(model, "sha256");
    const std::string name =
        "model " + text_of(model, "task") + " " + text_of(model, "method") + " " + sha256.substr(0, 12);
    if (!there.insert(sha256).second) {
      ++outcome.models_there;
      continue;
    }
    if (options.dry_run) {
      options.report(name + ": would send");
      continue;
    }
    BOOST_OUTCOME_TRY(const auto artifact,
                      field.call({"GET", "/api/v1/models/" + text_of(model, "id") + "/artifact"}));
    std::string failure;
    if (artifact.status != 200) {
      failure = in_words(artifact);
    } else {
      PeerRequest upload{"POST", "/api/v1/models", artifact.body};
      upload.idempotency_key = "sync-" + sha256;
      BOOST_OUTCOME_TRY(const auto answer, centre.call(upload));
      if (answer.status != 201) failure = in_words(answer);
    }
    if (failure.empty()) {
      ++outcome.models_sent;
      options.report(name + ": stored, not active");
    } else {
      refused(outcome, options, name + ": " + failure);
    }
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::sync
