#include "server/app/ws_places.hpp"

#include <algorithm>

namespace anchord::server {

WsPlaces::WsPlaces(WsPlaceLimits limits) : limits_(limits), state_(std::make_shared<State>()) {}

std::variant<std::shared_ptr<void>, WsPlaces::Refusal> WsPlaces::take(const api::Principal& who,
                                                                      bool counted) {
  const bool flies = who.has(api::Role::op) || who.has(api::Role::admin);
  const std::size_t reserved = flies ? 0 : std::min(limits_.reserved, limits_.all / 2);
  const std::lock_guard lock(state_->mutex);
  auto& own = state_->by_token[who.token_id];
  if (counted && own >= limits_.per_token) {
    return Refusal{4029, "too_many: " + std::to_string(own) + " connections of this token; close one"};
  }
  if (state_->all + reserved >= limits_.all) {
    if (own == 0) state_->by_token.erase(who.token_id);
    return Refusal{1013, "full: " + std::to_string(state_->all) + " of " + std::to_string(limits_.all) +
                             " connections" + (reserved > 0 ? ", the rest is for operators" : "")};
  }
  ++own;
  ++state_->all;
  return std::shared_ptr<void>(state_.get(), [state = state_, name = who.token_id](void*) {
    const std::lock_guard back(state->mutex);
    --state->all;
    const auto at = state->by_token.find(name);
    if (--at->second == 0) state->by_token.erase(at);
  });
}

std::size_t WsPlaces::taken() const {
  const std::lock_guard lock(state_->mutex);
  return state_->all;
}

}  // namespace anchord::server
