#include "api/learning/model_registry.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "api/learning/model_artifact.hpp"
#include "api/learning/range_features.hpp"

namespace anchord::api {
namespace {

using nlos::Feature;

/// Features only an impulse response gives.
constexpr std::array k_of_cir{Feature::kurtosis, Feature::mean_excess_delay_ns, Feature::rms_delay_spread_ns,
                              Feature::early_energy, Feature::peak_delay_ns};

Result<std::shared_ptr<const ml::Model>> read_model(const ModelSource& source, const ModelId& id,
                                                    bool vouched_only) {
  BOOST_OUTCOME_TRY(const auto artifact, source.artifact(id));
  if (vouched_only && artifact.standing == ModelStanding::foreign)
    return make_error(Errc::conflict,
                      "model " + to_string(id) +
                          " is not signed by this server: it was made on another server, or before models "
                          "were signed. Promote it: it is then evaluated on data of this server");
  BOOST_OUTCOME_TRY(auto model, read_model_artifact(artifact.text));
  return std::make_shared<const ml::Model>(std::move(model));
}

std::shared_ptr<const ml::Model>* slot(ml::ModelSet& set, const std::string& name) {
  const auto task = ml::k_task_words.find(name);
  if (!task) return nullptr;
  switch (*task) {
    case ml::Task::nlos_id:
      return &set.nlos_id;
    case ml::Task::los_bias:
      return &set.los_bias;
    case ml::Task::nlos_bias:
      return &set.nlos_bias;
    case ml::Task::bias:
      return &set.bias;
  }
  return nullptr;
}

/// Takes those that no range of a flight can feed (promoted by an older program) out of `wanted`, and says
/// which: another model of the same class would speak for them in silence.
std::string leave_unfed(const ModelSource& source, std::map<std::string, ModelId>& wanted) {
  std::string out;
  std::erase_if(wanted, [&](const auto& one) {
    const auto model = read_model(source, one.second, true);
    if (!model) return false;  // loading it says why
    const std::string lacking = lacking_in_flight(*model.value());
    if (lacking.empty()) return false;
    out += (out.empty() ? "" : "; ") + ("the promoted model of " + one.first) +
           " is not in use: no range of a flight has " + lacking;
    return true;
  });
  return out;
}

bool needs_cir(const ml::Model& model) {
  return std::ranges::any_of(model.info.features, [](const std::string& name) {
    const auto feature = nlos::feature_of(name);
    return feature && std::ranges::find(k_of_cir, *feature) != k_of_cir.end();
  });
}

void put_lacking(const ml::Model* model, const nlos::FeatureVector& features, std::string& out) {
  if (model == nullptr) return;
  for (const auto& name : model->info.features) {
    const auto feature = nlos::feature_of(name);
    if (feature && features.get(*feature)) continue;
    if (out.find(name) == std::string::npos) out += (out.empty() ? "" : ", ") + name;
  }
}

}  // namespace

Result<ModelRegistry::Active> load_models(const ModelSource& source,
                                          const std::map<std::string, ModelId>& models, ml::Correction how,
                                          bool vouched_only) {
  ModelRegistry::Active out;
  out.correction = how;
  ml::ModelSet set;
  for (const auto& [task, id] : models) {
    auto* place = slot(set, task);
    if (place == nullptr) return make_error(Errc::invalid_argument, "there is no task " + task);
    BOOST_OUTCOME_TRY(*place, read_model(source, id, vouched_only));
    out.models[task] = id;
    out.ids[static_cast<std::size_t>((*place)->info.task)] = id;
    out.needs_cir |= needs_cir(**place);
  }
  BOOST_OUTCOME_TRY(out.predictor, ml::Predictor::make(std::move(set)));
  return out;
}

Result<ModelRegistry::Active> models_together(std::vector<ml::Model> models, ml::Correction how) {
  ModelRegistry::Active out;
  out.correction = how;
  ml::ModelSet set;
  for (auto& model : models) {
    const std::string task(ml::task_name(model.info.task));
    auto* place = slot(set, task);
    if (place == nullptr || *place)
      return make_error(Errc::invalid_argument, "two models of the task " + task);
    out.needs_cir |= needs_cir(model);
    *place = std::make_shared<const ml::Model>(std::move(model));
  }
  BOOST_OUTCOME_TRY(out.predictor, ml::Predictor::make(std::move(set)));
  return out;
}

ModelRegistry::ModelRegistry(ModelSource source)
    : source_(source), active_(std::make_shared<const Active>()) {}

std::shared_ptr<const ModelRegistry::Active> ModelRegistry::active() const { return active_.copy(); }

Result<void> ModelRegistry::reload() {
  const std::scoped_lock one_at_a_time(reloading_);
  BOOST_OUTCOME_TRY(const auto promotions, source_.store().active());
  std::map<std::string, ModelId> wanted;
  ml::Correction how = ml::Correction::weighted;
  std::uint64_t newest = 0;
  for (const auto& one : promotions) {
    newest = std::max(newest, one.number);
    if (one.task == k_correction_task)
      how = ml::k_correction_words.find(one.reason).value_or(how);
    else if (one.model)
      wanted[one.task] = *one.model;
  }
  const std::string unfed = leave_unfed(source_, wanted);
  auto loaded = load_models(source_, wanted, how, true);
  Active next;
  if (loaded) {
    next = std::move(loaded).value();
    next.fault = unfed;
  } else {
    // A stored model of an older program: fly without it, and say so, rather than not at all.
    next.correction = how;
    next.fault = loaded.error().message;
  }
  next.newest = newest;
  // The models of before end after the lock: every range of a flight takes it.
  (void)active_.exchange(std::make_shared<const Active>(std::move(next)));
  return boost::outcome_v2::success();
}

ModelAnswer ModelRegistry::predict(const Active& active, const nlos::FeatureVector& features) {
  ModelAnswer out;
  if (active.predictor.empty()) {
    out.note = active.fault.empty() ? "no model is promoted" : active.fault;
    return out;
  }
  out.verdict = active.predictor.predict(features, active.correction);
  out.models = models_of(active, out.verdict);
  if (out.verdict.withheld_m) {
    out.note = withheld_words(out.verdict);
  } else if (!out.verdict.p_los && !out.verdict.bias_m) {
    std::string lacking;
    const auto& set = active.predictor.models();
    for (const auto& model : {set.nlos_id, set.los_bias, set.nlos_bias, set.bias})
      put_lacking(model.get(), features, lacking);
    out.note = lacking.empty() ? "the promoted models predict no class" : "the range lacks " + lacking;
  }
  return out;
}

std::optional<RangeModel> predict_range(const ModelRegistry::Active& active, const Range& range) {
  if (active.predictor.empty() || range.kind != RangeKind::tag_anchor) return std::nullopt;
  const auto verdict = active.predictor.predict(features_of(range, false), active.correction);
  if (!verdict.p_los && !verdict.bias_m && !verdict.withheld_m) return std::nullopt;
  return RangeModel{verdict.los,
                    verdict.p_los,
                    verdict.bias_m,
                    verdict.sigma_m,
                    verdict.outside_training,
                    ml::why_withheld(verdict.withheld),
                    error_model_of(verdict, active.correction),
                    models_of(active, verdict)};
}

std::string withheld_words(const ml::RangePrediction& verdict) {
  char metres[40];
  std::snprintf(metres, sizeof metres, "%.2f m", verdict.withheld_m.value_or(0));
  return "the correction of " + std::string(metres) +
         " is withheld: " + std::string(ml::why_withheld(verdict.withheld));
}

RangeModels models_of(const ModelRegistry::Active& active, const ml::RangePrediction& verdict) {
  const auto spoke = [&](ml::Task task) -> std::optional<ModelId> {
    if (!verdict.spoke.test(static_cast<std::size_t>(task))) return std::nullopt;
    return active.ids[static_cast<std::size_t>(task)];
  };
  return {spoke(ml::Task::nlos_id), spoke(ml::Task::los_bias), spoke(ml::Task::nlos_bias),
          spoke(ml::Task::bias)};
}

std::optional<RangeErrorModel> error_model_of(const ml::RangePrediction& verdict, ml::Correction how) {
  if (!verdict.likelihood || !verdict.bias_m || verdict.outside_training || how != ml::Correction::weighted)
    return std::nullopt;
  const ml::RangeLikelihood& l = *verdict.likelihood;
  return RangeErrorModel{l.p_los,        l.los_m - *verdict.bias_m,
                         l.los_sigma_m,  l.nlos_m - *verdict.bias_m,
                         l.nlos_sigma_m, l.nlos_excess_m};
}

}  // namespace anchord::api
