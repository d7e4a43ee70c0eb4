#pragma once

#include <bitset>
#include <memory>
#include <optional>
#include <span>

#include "core/base/result.hpp"
#include "core/ml/model.hpp"
#include "core/ml/plausible.hpp"
#include "core/nlos/features.hpp"

/// The live path's view of the promoted models: diagnostics of a range in, what the estimator needs out.
namespace anchord::ml {

/// What a range's bias may be: the estimator's likelihood.
/// f(b) = .99 [p N(b; los_m, los_sigma_m) + (1 - p) EMG(b; nlos_m, nlos_sigma_m, nlos_excess_m)] + .01 / 10 m
struct RangeLikelihood {
  double p_los{1};
  double los_m{}, los_sigma_m{};    ///< bias a LOS range has, and its spread
  double nlos_m{}, nlos_sigma_m{};  ///< Gaussian part of the NLOS bias
  double nlos_excess_m{};           ///< mean of the exponential delay on top; 0: none

  BiasDensity density() const;
};

enum class Correction : std::uint8_t {
  weighted,  ///< LOS and NLOS bias weighted by P(LOS), shrunk outside the training range
  hard,      ///< the dissertation's switch: the bias of the class that was called (6.5.2)
  none,
};
inline constexpr auto k_correction_words = enum_table<Correction>(
    {{"weighted", Correction::weighted}, {"hard", Correction::hard}, {"none", Correction::none}});

/// One range, judged.
struct RangePrediction {
  std::optional<bool> los{};
  std::optional<double> p_los{};
  std::optional<double> bias_m{};   ///< subtract from the measured range
  std::optional<double> sigma_m{};  ///< of what is left
  std::optional<RangeLikelihood> likelihood{};
  std::bitset<4> spoke{};   ///< by Task: the models that gave the class or the bias
  bool outside_training{};  ///< a feature lies beyond 3 sd of the training rows: the correction was shrunk
  Withheld withheld{Withheld::no};     ///< a correction was computed and is not given: then no bias_m,
  std::optional<double> withheld_m{};  ///< no sigma_m and no likelihood; what it was
};

/// The models promoted together; each may be absent. A `bias` model of both classes (mixture) stands in for
/// identification and both biases where those are absent.
struct ModelSet {
  std::shared_ptr<const Model> nlos_id{}, los_bias{}, nlos_bias{}, bias{};
};

/// threads  const use is safe from any thread; no allocation in `judge`
class Predictor {
 public:
  Predictor() = default;
  /// errors: not_found (a model names a feature outside the named set), invalid_argument (a model in the
  /// wrong slot), unsupported (another feature-set version)
  static Result<Predictor> make(ModelSet models);

  /// Empty verdict parts where a model is absent or the sample lacks one of its features.
  RangePrediction predict(const nlos::FeatureVector& features, Correction how = Correction::weighted) const;

  bool empty() const;
  const ModelSet& models() const { return models_; }

 private:
  struct Slot {
    const Model* model{};
    std::vector<nlos::Feature> columns{};
  };
  ModelSet models_{};
  Slot nlos_id_{}, los_bias_{}, nlos_bias_{}, bias_{};

  static Result<Slot> slot_of(const Model* model, Task first, Task other);
  void correct(const nlos::FeatureVector& features, Correction how, RangePrediction& out) const;
  static bool gather(const Slot& slot, const nlos::FeatureVector& features, std::span<double> out);
};

}  // namespace anchord::ml
