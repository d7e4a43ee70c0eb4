#include "api/learning/learning_json.hpp"

#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "api/admin/job_json.hpp"
#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "api/wire/row_limits.hpp"
#include "api/wire/rows_json.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

Ordered parsed(const std::string& text) {
  auto json = Ordered::parse(text, nullptr, false);
  return json.is_discarded() ? Ordered(nullptr) : json;
}

Ordered truth_json(const GroundTruth& t) {
  return {{"setting", t.setting},
          {"environment", t.environment},
          {"distance_m", or_null(t.distance_m)},
          {"los", or_null(t.los)},
          {"heading_deg", or_null(t.heading_deg)},
          {"height_difference_m", or_null(t.height_difference_m)},
          {"material", t.material},
          {"thickness_m", or_null(t.thickness_m)},
          {"truth_sigma_m", or_null(t.truth_sigma_m)}};
}

}  // namespace

Ordered campaign_json(const CampaignRecord& c, const std::vector<CampaignStore::Setting>* settings) {
  Ordered out{{"id", to_string(c.id)},
              {"name", c.name},
              {"radio", c.radio},
              {"note", c.note},
              {"truth_sigma_m", or_null(c.truth_sigma_m)},
              {"created_at", to_rfc3339(c.created)},
              {"version", c.version}};
  if (settings == nullptr) return out;
  std::uint64_t samples = 0;
  Ordered list = Ordered::array();
  for (const auto& s : *settings) {
    samples += s.n_samples;
    Ordered entry = truth_json(s.truth);
    entry["n_samples"] = s.n_samples;
    entry["mean_range_m"] = s.n_samples > 0 ? Ordered(s.mean_range_m) : Ordered(nullptr);
    entry["sd_range_m"] = or_null(s.sd_range_m);
    list.push_back(std::move(entry));
  }
  out["n_samples"] = samples;
  out["settings"] = std::move(list);
  return out;
}

void patch_campaign(const Json& body, bool whole, CampaignRecord& c, std::vector<FieldError>& errors) {
  Fields fields(body, "", errors);
  if (const auto name = fields.text("name", 200, whole)) {
    if (name->empty())
      fields.error("name", "out_of_range", "must not be empty");
    else
      c.name = *name;
  }
  const auto cleared = [&](const char* key) {
    return !whole && body.is_object() && body.contains(key) && body[key].is_null();
  };
  if (const auto radio = fields.text("radio", 200)) c.radio = *radio;
  if (const auto note = fields.text("note", 2000)) c.note = *note;
  if (const auto sigma = fields.number("truth_sigma_m", 0, 100)) c.truth_sigma_m = *sigma;
  if (cleared("truth_sigma_m")) c.truth_sigma_m.reset();
  fields.finish();
}

Ordered features_json(const nlos::FeatureVector& features) {
  Ordered out = Ordered::object();
  for (std::size_t f = 0; f < nlos::k_feature_count; ++f)
    if (features.present.test(f))
      out[std::string(nlos::feature_name(static_cast<nlos::Feature>(f)))] = features.values[f];
  return out;
}

Ordered sample_json(const CampaignStore::StoredSample& s) {
  const auto& x = s.sample;
  Ordered out{{"id", s.id}, {"t_us", x.time ? Ordered(x.time->us()) : Ordered(nullptr)}};
  out["seq"] = or_null(x.seq);
  out["range_m"] = x.range_m;
  out["truth"] = truth_json(s.truth);
  out["bias_m"] = s.truth.distance_m ? Ordered(x.range_m - *s.truth.distance_m) : Ordered(nullptr);
  out["rx_dbm"] = or_null(x.rx_dbm);
  out["fp_dbm"] = or_null(x.fp_dbm);
  out["std_noise"] = or_null(x.std_noise);
  out["has_cir"] = s.has_cir;
  return out;
}

Ordered dataset_json(const DatasetRecord& d, bool whole) {
  const Ordered report = parsed(d.report.text);
  Ordered out{{"id", to_string(d.id)},
              {"name", d.name},
              {"digest", d.digest},
              {"train", d.n_train},
              {"test", d.n_test},
              {"leak", report.is_object() && report.contains("leak") ? report["leak"] : Ordered(false)},
              {"created_at", to_rfc3339(d.created)},
              {"created_by", d.created_by}};
  if (!whole) return out;
  out["query"] = parsed(d.query.text);
  out["report"] = report;
  out["links"] =
      Ordered::array({{{"rel", "rows"}, {"href", "/api/v1/datasets/" + to_string(d.id) + "/rows"}},
                      {{"rel", "rules"}, {"href", "/api/v1/datasets/" + to_string(d.id) + "/rules"}}});
  return out;
}

Ordered training_run_json(const TrainingRun& r, const DatasetRecord& d, const Job& job, bool whole) {
  const std::string self = "/api/v1/training-runs/" + to_string(r.id);
  Ordered summary = r.summary.empty() ? Ordered::object() : parsed(r.summary.text);
  Ordered out{{"id", to_string(r.id)},
              {"state", k_job_state_words.word(job.state)},
              {"task", r.task},
              {"dataset", dataset_json(d, false)},
              {"method", summary.contains("method") ? summary["method"] : Ordered(nullptr)},
              {"created_at", to_rfc3339(r.created)},
              {"started_at", job.started ? Ordered(to_rfc3339(*job.started)) : Ordered(nullptr)},
              {"finished_at", job.finished ? Ordered(to_rfc3339(*job.finished)) : Ordered(nullptr)},
              {"created_by", r.created_by},
              {"model", r.model ? Ordered("/api/v1/models/" + to_string(*r.model)) : Ordered(nullptr)},
              {"job", "/api/v1/jobs/" + to_string(r.id)},
              {"worker", job.worker.empty() ? Ordered(nullptr) : Ordered(job.worker)},
              {"attempts", job.attempts},
              {"progress", job_json(job)["progress"]},
              {"metrics", summary.contains("metrics") ? summary["metrics"] : Ordered(nullptr)},
              {"problem", job_json(job)["problem"]}};
  if (!whole) return out;
  out["request"] = parsed(r.request.text);
  for (const char* key : {"why", "features", "results", "importance", "split", "threshold", "bias", "nll",
                          "nll_constants", "test"})
    out[key] = summary.contains(key) ? summary[key] : Ordered(nullptr);
  return out;
}

Ordered model_json(const StoredModel& m, bool active) {
  const std::string self = "/api/v1/models/" + to_string(m.id);
  const Ordered manifest = parsed(m.manifest.text);
  const auto from = [&](const char* key) {
    return manifest.is_object() && manifest.contains(key) ? manifest[key] : Ordered(nullptr);
  };
  return {{"id", to_string(m.id)},
          {"task", m.task},
          {"method", m.method},
          {"active", active},
          {"features", from("features")},
          {"feature_set", from("feature_set")},
          {"metrics", from("metrics")},
          {"sha256", m.sha256_hex},
          {"training_run", m.run ? Ordered("/api/v1/training-runs/" + to_string(*m.run)) : Ordered(nullptr)},
          {"created_at", to_rfc3339(m.created)},
          {"created_by", m.created_by},
          {"manifest", manifest},
          {"links", Ordered::array({{{"rel", "artifact"}, {"href", self + "/artifact"}}})}};
}

Ordered promotion_json(const Promotion& p) {
  return {{"number", p.number},
          {"task", p.task},
          {"model", p.model ? Ordered(to_string(*p.model)) : Ordered(nullptr)},
          {"promoted_at", to_rfc3339(p.time)},
          {"promoted_by", p.by},
          {"reason", p.reason},
          {"rollback", p.rollback}};
}

Ordered gate_json(const GateReport& gate) {
  Ordered checks = Ordered::array();
  for (const auto& check : gate.checks)
    checks.push_back({{"name", check.name},
                      {"candidate", or_null(check.candidate)},
                      {"current", or_null(check.current)},
                      {"passed", check.passed},
                      {"basis", check.basis}});
  return {
      {"passed", gate.passed}, {"standing", gate.standing}, {"why", gate.why}, {"checks", std::move(checks)}};
}

Ordered range_models_json(const RangeModels& models) {
  Ordered out = Ordered::object();
  const auto put = [&out](const char* task, const std::optional<ModelId>& id) {
    if (id) out[task] = to_string(*id);
  };
  put("nlos_id", models.nlos_id);
  put("los_bias", models.los_bias);
  put("nlos_bias", models.nlos_bias);
  put("bias", models.bias);
  return out;
}

Ordered model_answer_json(const ModelAnswer& j) {
  const auto& v = j.verdict;
  Ordered out{{"los", or_null(v.los)},
              {"p_los", or_null(v.p_los)},
              {"bias_m", or_null(v.bias_m)},
              {"sigma_m", or_null(v.sigma_m)},
              {"outside_training", v.outside_training},
              {"note", j.note.empty() ? Ordered(nullptr) : Ordered(j.note)},
              {"models", range_models_json(j.models)}};
  out["likelihood"] = v.likelihood ? Ordered{{"p_los", v.likelihood->p_los},
                                             {"los_m", v.likelihood->los_m},
                                             {"los_sigma_m", v.likelihood->los_sigma_m},
                                             {"nlos_m", v.likelihood->nlos_m},
                                             {"nlos_sigma_m", v.likelihood->nlos_sigma_m},
                                             {"nlos_excess_m", v.likelihood->nlos_excess_m}}
                                   : Ordered(nullptr);
  return out;
}

nlos::FeatureVector read_features(const Json& sample, const std::string& at,
                                  std::vector<FieldError>& errors) {
  Fields fields(sample, at, errors);
  nlos::DiagnosticSample s;
  std::set<std::string_view> measured;
  const auto take = [&](const char* key, std::optional<double>& into, double low, double high) {
    measured.insert(key);
    if (const auto value = fields.number(key, low, high)) into = *value;
  };
  take("range_m", s.range_m, 0.01, 1e4);
  take("distance_m", s.range_m, 0.01, 1e4);
  take("rss_dbm", s.rx_dbm, row_limits::k_dbm.min, row_limits::k_dbm.max);
  take("rx_dbm", s.rx_dbm, row_limits::k_dbm.min, row_limits::k_dbm.max);
  take("fp_dbm", s.fp_dbm, row_limits::k_dbm.min, row_limits::k_dbm.max);
  take("fp_amp1", s.fp_amp1, 0, 1e6);
  take("fp_amp2", s.fp_amp2, 0, 1e6);
  take("fp_amp3", s.fp_amp3, 0, 1e6);
  take("cir_power", s.cir_power, 0, 1e9);
  take("preamble_count", s.preamble_count, 0, 1e6);
  take("std_noise", s.std_noise, 0, 1e6);
  take("max_noise", s.max_noise, 0, 1e6);
  take("fp_index", s.fp_index, 0, 1e5);
  take("height_difference_m", s.height_difference_m, -1e4, 1e4);
  take("heading_deg", s.heading_deg, -720, 720);
  auto out = nlos::compute_features(s);
  // Features that were computed elsewhere, by their own names.
  for (std::size_t f = 0; f < nlos::k_feature_count; ++f) {
    const auto feature = static_cast<nlos::Feature>(f);
    const std::string name(nlos::feature_name(feature));
    // What was measured is in the features already, as training has it: levels of registers where both are
    // given.
    if (!fields.has(name) || (measured.contains(name) && out.present.test(f))) continue;
    if (const auto value = fields.number(name, -1e9, 1e9)) out.set(feature, *value);
  }
  fields.finish();
  return out;
}

}  // namespace anchord::api
