#pragma once

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "api/learning/model_signer.hpp"
#include "core/base/locked.hpp"
#include "core/ml/predictor.hpp"
#include "core/ports/learning_store.hpp"
#include "core/types/range.hpp"
#include "core/types/range_model.hpp"

namespace anchord::api {

/// What the promoted models say about one range, or why they say nothing.
struct ModelAnswer {
  ml::RangePrediction verdict{};
  RangeModels models{};
  /// Empty when classified: "no model is promoted", "lacks std_noise ...", or that a correction is withheld.
  std::string note;
};

/// Which models are active, ready for use. Thread-safe: a promotion takes effect at the next range judged.
class ModelRegistry {
 public:
  explicit ModelRegistry(ModelSource source);

  struct Active {
    ml::Predictor predictor{};
    std::map<std::string, ModelId> models{};      ///< by task
    std::array<std::optional<ModelId>, 4> ids{};  ///< the same, by ml::Task
    ml::Correction correction{ml::Correction::weighted};
    bool needs_cir{false};
    std::uint64_t newest{0};  ///< number of the newest promotion; 0: none
    std::string fault{};      ///< why a promoted model is not in use
  };
  /// Never null.
  std::shared_ptr<const Active> active() const;
  /// After a promotion, at the start, and where the store has a newer one: a promotion whose answer was lost
  /// on the way from the database took place all the same. A model that cannot be used leaves its task
  /// without one, and `fault` says so.
  Result<void> reload();

  const ModelSource& source() const { return source_; }

  static ModelAnswer predict(const Active& active, const nlos::FeatureVector& features);

 private:
  ModelSource source_;
  std::mutex reloading_;  ///< one at a time, or the slower of two promotions leaves the older state in use
  Locked<std::shared_ptr<const Active>> active_;
};

/// A correction that is not given, and why.
std::string withheld_words(const ml::RangePrediction& verdict);

/// In the form a flight keeps with the range. Nothing where the models say nothing.
std::optional<RangeModel> predict_range(const ModelRegistry::Active& active, const Range& range);

/// Of those active, the models that gave a verdict its class or bias.
RangeModels models_of(const ModelRegistry::Active& active, const ml::RangePrediction& verdict);

/// The same as a likelihood, of the error that is left once the correction is taken off. Nothing without a
/// class and both biases, outside of what was trained (its density says nothing there), or where the
/// corrections "hard" and "none" ask for the range as it is.
std::optional<RangeErrorModel> error_model_of(const ml::RangePrediction& verdict, ml::Correction how);

/// Promotions of this "task" say which correction is in use, in their reason.
inline constexpr std::string_view k_correction_task = "correction";

/// Active in place of the given ones where `overrides` names another; an absent id is no model. For a
/// calibration with models of its choice. One that was edited after it was signed is a conflict, and so, with
/// `vouched_only`, is one from elsewhere that was never promoted here.
Result<ModelRegistry::Active> load_models(const ModelSource& source,
                                          const std::map<std::string, ModelId>& models, ml::Correction how,
                                          bool vouched_only);

/// The same without a store: each model takes the place of the task it was trained for.
/// errors: invalid_argument (two of one task), those of Predictor::make
Result<ModelRegistry::Active> models_together(std::vector<ml::Model> models, ml::Correction how);

}  // namespace anchord::api
