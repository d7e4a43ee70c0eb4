#include "api/admin/running_time.hpp"

#include "core/ports/mission_bin.hpp"

namespace anchord::api {

RunningTime::RunningTime(ServiceStore& store, const SteadyClock& steady)
    : store_(store), steady_(steady), started_(steady.now()) {
  const auto before = store_.running_ns();
  known_ = before.has_value();
  if (known_) before_ns_ = before.value();
}

std::int64_t RunningTime::now_ns() const { return before_ns_ + (steady_.now().ns - started_.ns); }

void RunningTime::keep() const {
  // What could not be read is not written over: this start does not count, and nothing ends early.
  if (known_) (void)store_.keep_running_ns(now_ns()).has_value();
}

}  // namespace anchord::api
