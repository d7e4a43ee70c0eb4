// Models that no calibration brought along: the same artifact is the same model, whatever its id.
#include <nlohmann/json.hpp>

#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {

using Json = nlohmann::json;

Result<void> send_models(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome) {
  BOOST_OUTCOME_TRY(const auto ours, field.list("/api/v1/models?fields=id,task,method,sha256"));
  BOOST_OUTCOME_TRY(const auto theirs, centre.list("/api/v1/models?fields=sha256"));
  std::set<std::string> there;
  for (const auto& model : theirs) there.insert(text_of(model, "sha256"));
  for (const auto& model : ours) {
    const std::string name = "model " + text_of(model, "task") + " " + text_of(model, "method") + " " +
                             text_of(model, "sha256").substr(0, 12);
    if (there.contains(text_of(model, "sha256"))) {
      ++outcome.models_there;
      continue;
    }
    if (options.dry_run) {
      options.tell(name + ": would send");
      continue;
    }
    BOOST_OUTCOME_TRY(const auto artifact,
                      field.call("GET", "/api/v1/models/" + text_of(model, "id") + "/artifact"));
    if (artifact.status != 200) {
      outcome.failed.push_back(name + ": " + told(artifact));
      continue;
    }
    BOOST_OUTCOME_TRY(const auto answer, centre.call("POST", "/api/v1/models", artifact.body));
    if (answer.status == 201) {
      ++outcome.models_sent;
      there.insert(text_of(model, "sha256"));
    } else {
      outcome.failed.push_back(name + ": " + told(answer));
    }
    options.tell(name + (answer.status == 201 ? ": arrived, not active" : ": " + told(answer)));
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::sync
