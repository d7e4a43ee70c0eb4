#pragma once

#include <string>
#include <vector>

#include "api/admin/event_log.hpp"
#include "core/ports/learning_store.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord::api {

/// What is told of a promotion: the same words when it happens and when it is read again after a restart.
struct PromotionWords {
  std::string code, text;
};
/// method  of the model that is active from here on
PromotionWords promotion_words(const Promotion& promotion, const std::string& method);

/// The newest promotions as events, oldest first: in the log, and in the flights that were recording then.
/// They are made again from what the store keeps, for a log lives in memory and a switch of models must not
/// be lost.
Result<std::vector<LiveEvent>> promotion_events(ModelStore& models, MissionStore& missions);

}  // namespace anchord::api
