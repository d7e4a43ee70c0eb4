#include "api/admin/job_json.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

Ordered job_json(const Job& job) {
  static const std::vector<std::string> k_solving{"queued", "load", "solve", "store"};
  static const std::vector<std::string> k_training{"queued",     "load",      "split", "search",
                                                   "importance", "selection", "test",  "store"};
  const auto& k_stages = job.kind == "training" ? k_training : k_solving;
  std::size_t stage = 0;
  while (stage + 1 < k_stages.size() && k_stages[stage] != job.stage) ++stage;
  const std::string self = "/api/v1/jobs/" + to_string(job.id);
  Ordered links = Ordered::array();
  if (!job.result_href.empty()) links.push_back({{"rel", "result"}, {"href", job.result_href}});
  if (job.state == JobState::queued || job.state == JobState::running)
    links.push_back({{"rel", "cancel"}, {"href", self}, {"method", "DELETE"}});
  Ordered out{{"id", to_string(job.id)}, {"kind", job.kind}, {"state", k_job_state_words.word(job.state)}};
  out["progress"] = {{"fraction", job.fraction},       {"stage", job.stage},   {"stage_index", stage},
                     {"stage_count", k_stages.size()}, {"detail", job.detail}, {"eta_s", nullptr}};
  out["created_at"] = to_rfc3339(job.created);
  out["started_at"] = job.started ? Ordered(to_rfc3339(*job.started)) : Ordered(nullptr);
  out["finished_at"] = job.finished ? Ordered(to_rfc3339(*job.finished)) : Ordered(nullptr);
  out["worker"] = job.worker.empty() ? Ordered(nullptr) : Ordered(job.worker);
  out["attempts"] = job.attempts;
  out["links"] = std::move(links);
  out["problem"] = kept_json(job.problem.text);
  return out;
}

}  // namespace anchord::api
