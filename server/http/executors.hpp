#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "api/kit/work.hpp"
#include "core/base/locked.hpp"

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
  explicit Shares(std::size_t per_name) : taken_(std::make_shared<Taken>()), per_name_(per_name) {}

  /// One share, for as long as somebody holds it; null when the name has all of its own.
  std::shared_ptr<void> take(const std::string& name) {
    {
      auto taken = taken_->lock();
      const auto at = taken->find(name);
      if ((at == taken->end() ? 0 : at->second) >= per_name_) return nullptr;
      ++(*taken)[name];
    }
    // Not null, whatever it points to: null says that there is none left. Not under the lock: without memory
    // for it the share is given back at once.
    return {taken_.get(), [all = taken_, name](void*) {
              auto taken = all->lock();
              const auto at = taken->find(name);
              if (--at->second == 0) taken->erase(at);
            }};
  }
  std::size_t per_name() const { return per_name_; }

 private:
  using Taken = Locked<std::map<std::string, std::size_t>>;
  const std::shared_ptr<Taken> taken_;
  const std::size_t per_name_;
};

}  // namespace anchord::server
