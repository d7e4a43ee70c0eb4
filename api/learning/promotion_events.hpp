#pragma once

#include <string>
#include <vector>

#include "api/admin/event_log.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord::api {

/// What is told of a promotion: the same words when it happens and when it is read again after a restart.
struct PromotionWords {
  std::string code, text;
};
/// method  of the model that is active from here on
PromotionWords promotion_words(const Promotion& promotion, const std::string& method);

/// The newest promotions as events, oldest first. They are made again from what the store keeps, for a log
/// lives in memory and a switch of models must not be lost; those of flights are kept with them
/// (api/admin/flight_events).
Result<std::vector<LiveEvent>> promotion_events(ModelStore& models);

}  // namespace anchord::api
