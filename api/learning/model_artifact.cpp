#include "api/learning/model_artifact.hpp"

#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "core/nlos/features.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

Ordered json_of(const ml::Scaler& s) { return {{"mean", s.mean}, {"sd", s.sd}, {"clip", s.clip}}; }

Ordered json_of(const ml::Scorer& scorer) {
  struct Writer {
    static std::string_view kind(ml::ScorerKind k) { return ml::k_scorer_words.word(k); }
    Ordered operator()(const ml::Linear& m) const {
      return {{"kind", kind(ml::ScorerKind::linear)}, {"weights", m.weights}, {"offset", m.offset}};
    }
    Ordered operator()(const ml::Polynomial& m) const {
      Ordered terms = Ordered::array();
      for (const auto& t : m.terms)
        terms.push_back({{"features", t.features}, {"coefficient", t.coefficient}});
      return {{"kind", kind(ml::ScorerKind::polynomial)}, {"terms", terms}};
    }
    Ordered operator()(const ml::Trees& m) const {
      Ordered feature = Ordered::array(), left = Ordered::array(), value = Ordered::array();
      for (const auto& n : m.nodes) {
        feature.push_back(n.feature);
        left.push_back(n.left);
        value.push_back(n.value);
      }
      return {{"kind", kind(ml::ScorerKind::trees)},
              {"base", m.base},
              {"scale", m.scale},
              {"roots", m.roots},
              {"feature", feature},
              {"left", left},
              {"value", value}};
    }
    Ordered operator()(const ml::Svm& m) const {
      return {{"kind", kind(ml::ScorerKind::svm)},
              {"kernel", ml::k_kernel_words.word(m.kernel)},
              {"gamma", m.gamma},
              {"coef0", m.coef0},
              {"degree", m.degree},
              {"dims", m.dims},
              {"rho", m.rho},
              {"alpha", m.alpha},
              {"support", m.support}};
    }
  };
  return std::visit(Writer{}, scorer);
}

Ordered json_of(const ml::Classifier& c) {
  Ordered members = Ordered::array();
  for (const auto& m : c.members)
    members.push_back(
        {{"share", m.share}, {"slope", m.slope}, {"offset", m.offset}, {"scorer", json_of(m.scorer)}});
  return {{"scaler", json_of(c.scaler)},
          {"slope", c.slope},
          {"offset", c.offset},
          {"p_min", c.p_min},
          {"p_max", c.p_max},
          {"threshold", c.threshold},
          {"members", members}};
}

Ordered json_of(const ml::BiasMixture& m) {
  Ordered tail = Ordered::array();
  for (const auto& t : m.tail)
    tail.push_back({{"feature", t.feature}, {"mean", t.mean}, {"sd", t.sd}, {"weight", t.weight}});
  const auto& s = m.shared;
  Ordered out{{"shared",
               {{"centre_m", s.centre_m},
                {"kappa", s.kappa},
                {"features", s.features},
                {"mean", s.mean},
                {"sd", s.sd},
                {"low", s.low},
                {"high", s.high},
                {"weight", s.weight},
                {"offset_m", s.offset_m}}},
              {"m0_m", m.m0_m},
              {"s0_m", m.s0_m},
              {"m1_m", m.m1_m},
              {"s1_m", m.s1_m},
              {"log_tau", m.log_tau},
              {"tail", tail},
              {"quantile", m.quantile},
              {"gain", m.gain}};
  if (m.seen) out["seen"] = {{"min_m", m.seen->min_m}, {"max_m", m.seen->max_m}};
  return out;
}

}  // namespace

std::string write_model_artifact(const ml::Model& model) {
  const auto& i = model.info;
  nlohmann::json metrics =
      nlohmann::json::object();  // sorted by name, so that reading and writing again gives the same bytes
  for (const auto& [name, value] : i.metrics) metrics[name] = value;
  Ordered out{
      {"format", k_model_format},
      {"manifest",
       {{"task", ml::task_name(i.task)},
        {"method", i.method},
        {"feature_set", i.feature_set},
        {"features", i.features},
        {"data",
         {{"digest", i.data_digest}, {"rows", i.rows}, {"placements", i.placements}, {"groups", i.groups}}},
        {"split", {{"group_by", i.group_by}, {"folds", i.folds}}},
        {"seed", i.seed},
        {"metrics", metrics},
        {"code_version", i.code_version},
        {"why", i.why}}}};
  if (!i.not_for_live.empty()) out["manifest"]["not_for_live"] = i.not_for_live;
  if (model.classifier) out["classifier"] = json_of(*model.classifier);
  if (model.regressor) {
    const auto& r = *model.regressor;
    out["regressor"] = {
        {"scaler", json_of(r.scaler)}, {"scorer", json_of(r.scorer)}, {"min_m", r.min_m}, {"max_m", r.max_m},
        {"fallback_m", r.fallback_m},  {"sigma_m", r.sigma_m}};
  }
  if (model.mixture) out["mixture"] = json_of(*model.mixture);
  return to_wire(out) + "\n";
}

Result<std::string> checked_model_artifact(const ml::Model& model) {
  std::string text = write_model_artifact(model);
  if (const auto again = read_model_artifact(text); !again)
    return make_error(
        again.error().code,
        "the model that was made could not be read again and is not kept: " + again.error().message);
  return text;
}

}  // namespace anchord::api
