#include "api/learning/promotion_events.hpp"

#include <algorithm>
#include <utility>

#include "api/learning/model_registry.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_promotions = 500;

}  // namespace

PromotionWords promotion_words(const Promotion& p, const std::string& method) {
  if (p.task == k_correction_task) return {"model.correction", "ranges are now corrected " + p.reason};
  if (!p.rollback)
    return {"model.promoted",
            method + " " + to_string(p.model.value_or(ModelId{})) + " is now the model of " + p.task};
  return {"model.rolled_back",
          p.model ? "rolled back: " + to_string(*p.model) + " is the model of " + p.task + " again"
                  : "rolled back: " + p.task + " has no model now"};
}

Result<std::vector<LiveEvent>> promotion_events(ModelStore& models) {
  BOOST_OUTCOME_TRY(auto promotions, models.promotions("", k_most_promotions));
  std::reverse(promotions.begin(), promotions.end());
  std::vector<LiveEvent> out;
  for (const auto& p : promotions) {
    std::string method;
    if (p.model) {
      BOOST_OUTCOME_TRY(const auto model, models.model(*p.model));
      method = model.method;
    }
    auto words = promotion_words(p, method);
    out.push_back({.id = EventId{make_uuid_v7(p.time)},
                   .time = p.time,
                   .level = EventLevel::info,
                   .code = std::move(words.code),
                   .text = std::move(words.text)});
  }
  return out;
}

}  // namespace anchord::api
