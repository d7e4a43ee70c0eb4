#include "core/ml/predictor.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace anchord::ml {
namespace {

// A mixture's density with the applied correction's exponential part; metres.
RangeLikelihood likelihood_of(const BiasDensity& d) {
  return {d.p_los, d.shared_m + d.m0_m, d.s0_m, d.shared_m + d.m1_m, d.s1_m, d.tau_m};
}

double furthest_sd(const Scaler& scaler, std::span<const double> x) {
  double most = 0;
  for (std::size_t i = 0; i < scaler.mean.size(); ++i)
    most = std::max(most, std::abs(x[i] - scaler.mean[i]) / scaler.sd[i]);
  return most;
}

constexpr double k_outside_sd = 3;

constexpr std::size_t bit(Task task) { return static_cast<std::size_t>(task); }

}  // namespace

BiasDensity RangeLikelihood::density() const {
  return {p_los, 0, los_m, los_sigma_m, nlos_m, nlos_sigma_m, std::max(nlos_excess_m, 1e-3)};
}

Result<Predictor::Slot> Predictor::slot_of(const Model* model, Task first, Task other) {
  Slot slot{model, {}};
  if (model == nullptr) return slot;
  if (model->info.task != first && model->info.task != other)
    return make_error(Errc::invalid_argument, "a model of task " + std::string{task_name(model->info.task)} +
                                                  " cannot serve as " + std::string{task_name(first)});
  for (const auto& name : model->info.features)
    if (!model->info.feature_set.empty() && !nlos::means_the_same(model->info.feature_set, name))
      return make_error(Errc::unsupported, "the model was trained on " + name + " of " +
                                               model->info.feature_set + ", this build computes " +
                                               std::string{nlos::k_feature_set_version} + ": train it again");
  if (model->info.features.size() > k_max_features)
    return make_error(Errc::invalid_argument, "the model needs more than 64 features");
  for (const auto& name : model->info.features) {
    const auto feature = nlos::feature_of(name);
    if (!feature)
      return make_error(Errc::not_found,
                        "the model needs " + name + ", a column of its table that live ranges do not have");
    slot.columns.push_back(*feature);
  }
  return slot;
}

Result<Predictor> Predictor::make(ModelSet models) {
  Predictor out;
  BOOST_OUTCOME_TRY(out.nlos_id_, slot_of(models.nlos_id.get(), Task::nlos_id, Task::bias));
  BOOST_OUTCOME_TRY(out.los_bias_, slot_of(models.los_bias.get(), Task::los_bias, Task::los_bias));
  BOOST_OUTCOME_TRY(out.nlos_bias_, slot_of(models.nlos_bias.get(), Task::nlos_bias, Task::nlos_bias));
  BOOST_OUTCOME_TRY(out.bias_, slot_of(models.bias.get(), Task::bias, Task::bias));
  out.models_ = std::move(models);
  return out;
}

bool Predictor::empty() const {
  return !models_.nlos_id && !models_.los_bias && !models_.nlos_bias && !models_.bias;
}

bool Predictor::gather(const Slot& slot, const nlos::FeatureVector& features, std::span<double> out) {
  if (slot.model == nullptr) return false;
  for (std::size_t i = 0; i < slot.columns.size(); ++i) {
    const auto at = static_cast<std::size_t>(slot.columns[i]);
    if (!features.present.test(at)) return false;
    out[i] = features.values[at];
  }
  return true;
}

/// The bias of the models that have the range's features, and whether the range is like those they learned
/// of.
void Predictor::correct(const nlos::FeatureVector& features, Correction how, RangePrediction& out) const {
  std::array<double, k_max_features> x;
  const auto far_off = [&](const Scaler& scaler) {
    const double sd = furthest_sd(scaler, x);
    out.outside_training |= sd > k_outside_sd;
    return sd > k_far_sd;
  };
  struct OneClass {
    double bias_m{}, sigma_m{};
    bool far{};
  };
  bool far = false;
  const auto one_class = [&](const Slot& slot) -> std::optional<OneClass> {
    if (slot.model == nullptr || !slot.model->regressor || !gather(slot, features, x)) return std::nullopt;
    return OneClass{slot.model->regressor->bias_m(x), slot.model->regressor->sigma_m,
                    far_off(slot.model->regressor->scaler)};
  };
  const auto los = one_class(los_bias_), nlos = one_class(nlos_bias_);
  if (out.p_los && los && nlos) {
    // Two Gaussians: the dissertation's models carry no tail of their own.
    const RangeLikelihood l{*out.p_los, los->bias_m, los->sigma_m, nlos->bias_m, nlos->sigma_m, 0};
    out.likelihood = l;
    const double p = how == Correction::hard ? (*out.los ? 1.0 : 0.0) : *out.p_los;
    const double mean = p * los->bias_m + (1 - p) * nlos->bias_m;
    const double second = p * (los->sigma_m * los->sigma_m + los->bias_m * los->bias_m) +
                          (1 - p) * (nlos->sigma_m * nlos->sigma_m + nlos->bias_m * nlos->bias_m);
    out.bias_m = mean;
    out.sigma_m = std::sqrt(std::max(1e-6, second - mean * mean));
    out.spoke.set(bit(Task::los_bias)).set(bit(Task::nlos_bias));
    far = los->far || nlos->far;
  } else if (const auto* m = bias_.model; m != nullptr && gather(bias_, features, x)) {
    out.spoke.set(bit(Task::bias));
    if (m->mixture && m->classifier) {
      const double p = out.p_los.value_or(m->classifier->p_los(x));
      const auto density = density_of(*m->mixture, p, x);
      out.likelihood = likelihood_of(density);
      if (how == Correction::hard) {
        const bool is_los = out.los.value_or(p >= m->classifier->threshold);
        out.bias_m =
            is_los ? density.shared_m + density.m0_m : density.shared_m + density.m1_m + density.tau_m;
      } else {
        out.bias_m = m->mixture->correction_m(density);
      }
      out.sigma_m = density.sigma_m();
      far = far_off(m->classifier->scaler);
      if (m->mixture->far_beyond_seen(*out.bias_m)) out.withheld = Withheld::unseen_bias;
    } else if (m->regressor) {
      out.bias_m = m->regressor->bias_m(x);
      out.sigma_m = m->regressor->sigma_m;
      far = far_off(m->regressor->scaler);
    }
  } else if (los && !nlos_bias_.model) {
    out.spoke.set(bit(Task::los_bias));
    out.bias_m = out.p_los ? *out.p_los * los->bias_m : los->bias_m;
    // What a range that is not called LOS is off by, no model here knows.
    if (out.los.value_or(false)) out.sigma_m = los->sigma_m;
    far = los->far;
  }
  if (far) out.withheld = Withheld::far_features;
}

RangePrediction Predictor::predict(const nlos::FeatureVector& features, Correction how) const {
  RangePrediction out;
  std::array<double, k_max_features> x;
  // Class: the identification model, else the classifier inside the bias model.
  for (const Slot* slot : {&nlos_id_, &bias_}) {
    if (out.p_los || slot->model == nullptr || !slot->model->classifier) continue;
    if (!gather(*slot, features, x)) continue;
    out.p_los = slot->model->classifier->p_los(x);
    out.los = *out.p_los >= slot->model->classifier->threshold;
    out.outside_training = furthest_sd(slot->model->classifier->scaler, x) > k_outside_sd;
    out.spoke.set(bit(slot == &bias_ ? Task::bias : Task::nlos_id));
  }
  const auto gave_class = out.spoke;
  correct(features, how, out);
  if (how == Correction::none) {
    out.withheld = Withheld::no;
    if (out.bias_m) out.bias_m = 0;
    return out;
  }
  const auto range_m = features.get(nlos::Feature::range_m);
  if (out.withheld == Withheld::no && out.bias_m && range_m && !plausible_correction(*range_m, *out.bias_m))
    out.withheld = Withheld::implausible;
  if (out.withheld == Withheld::no) return out;
  out.withheld_m = out.bias_m;
  out.spoke = gave_class;
  out.bias_m.reset();
  out.sigma_m.reset();
  out.likelihood.reset();
  return out;
}

}  // namespace anchord::ml
