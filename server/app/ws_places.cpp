#include "server/app/ws_places.hpp"

#include <algorithm>

namespace anchord::server {

WsPlaces::WsPlaces(WsPlaceLimits limits) : limits_(limits), taken_(std::make_shared<Locked<Taken>>()) {}

/// Nothing: the place is counted.
std::optional<WsPlaces::Refusal> WsPlaces::refusal(Taken& taken, const api::Principal& who,
                                                   bool counted) const {
  const bool flies = who.has(api::Role::op) || who.has(api::Role::admin);
  const std::size_t reserved = flies ? 0 : std::min(limits_.reserved, limits_.all / 2);
  const auto at = taken.by_token.find(who.token_id);
  const std::size_t own = at == taken.by_token.end() ? 0 : at->second;
  if (counted && own >= limits_.per_token) {
    return Refusal{4029,
                   "too_many: " + std::to_string(own) + " connections of this token; close one of them"};
  }
  if (taken.all + reserved >= limits_.all) {
    return Refusal{1013, "full: " + std::to_string(taken.all) + " of " + std::to_string(limits_.all) +
                             " connections" +
                             (reserved > 0 ? ", the remaining ones are reserved for operators" : "")};
  }
  ++taken.by_token[who.token_id];
  ++taken.all;
  return std::nullopt;
}

std::variant<std::shared_ptr<void>, WsPlaces::Refusal> WsPlaces::take(const api::Principal& who,
                                                                      bool counted) {
  {
    auto taken = taken_->lock();
    if (auto why = refusal(*taken, who, counted)) return std::move(*why);
  }
  // Not under the lock: without memory for it the place is given back at once.
  return std::shared_ptr<void>(taken_.get(), [all = taken_, name = who.token_id](void*) {
    auto taken = all->lock();
    --taken->all;
    const auto at = taken->by_token.find(name);
    if (--at->second == 0) taken->by_token.erase(at);
  });
}

std::size_t WsPlaces::taken() const {
  const auto taken = taken_->lock();
  return taken->all;
}

}  // namespace anchord::server
