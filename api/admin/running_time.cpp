#include "api/admin/running_time.hpp"

#include "core/ports/mission_bin.hpp"

namespace anchord::api {

RunningTime::RunningTime(ServiceStore& store, const SteadyClock& steady)
    : store_(store), steady_(steady), started_(steady.now()) {
  if (const auto before = store_.running_ns()) before_ns_ = before.value();
}

std::int64_t RunningTime::now_ns() const { return before_ns_ + (steady_.now().ns - started_.ns); }

void RunningTime::keep() const { (void)store_.keep_running_ns(now_ns()).has_value(); }

}  // namespace anchord::api
