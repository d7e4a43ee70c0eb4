#pragma once

#include <cstdint>

#include "core/base/steady.hpp"

namespace anchord {
class ServiceStore;
}

namespace anchord::api {

/// How long this database has been served, over all starts: what "24 h" and "30 days" mean where a record
/// outlives the process. Only running makes it pass, so that no step of the system clock empties a bin. A
/// crash loses what passed since the last keep(), at most a minute: things last that much longer.
/// Thread-safe.
class RunningTime {
 public:
  RunningTime(ServiceStore& store, const SteadyClock& steady);
  std::int64_t now_ns() const;
  void keep() const;

 private:
  ServiceStore& store_;
  const SteadyClock& steady_;
  std::int64_t before_ns_{0};
  bool known_{false};  ///< what was kept of before could be read
  const SteadyTime started_;
};

}  // namespace anchord::api
