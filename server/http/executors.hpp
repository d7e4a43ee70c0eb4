#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "api/kit/work.hpp"

namespace anchord::server {

class WorkerPool;

/// The pools that run handlers, by the class of the route.
struct Executors {
  WorkerPool& ordinary;
  WorkerPool& uploads;  ///< handlers that wait for a body: a slow upload must not hold the others up
  WorkerPool& command;
  WorkerPool& flight;
  WorkerPool& heavy;

  WorkerPool& of(api::Work work) const {
    switch (work) {
      case api::Work::command:
        return command;
      case api::Work::flight:
        return flight;
      case api::Work::heavy:
        return heavy;
      case api::Work::ordinary:
        break;
    }
    return ordinary;
  }
};

/// So many of a kind at once for each name. Thread-safe.
class Shares {
 public:
  explicit Shares(std::size_t per_name) : state_(std::make_shared<State>()), per_name_(per_name) {}

  /// One share, for as long as somebody holds it; null when the name has all of its own.
  std::shared_ptr<void> take(const std::string& name) {
    const std::lock_guard lock(state_->mutex);
    auto& taken = state_->taken[name];
    if (taken >= per_name_) return nullptr;
    ++taken;
    // Not null, whatever it points to: null says that there is none left.
    return {state_.get(), [state = state_, name](void*) {
              const std::lock_guard back(state->mutex);
              const auto at = state->taken.find(name);
              if (--at->second == 0) state->taken.erase(at);
            }};
  }
  std::size_t per_name() const { return per_name_; }

 private:
  struct State {
    std::mutex mutex;
    std::map<std::string, std::size_t> taken;
  };
  const std::shared_ptr<State> state_;
  const std::size_t per_name_;
};

}  // namespace anchord::server
