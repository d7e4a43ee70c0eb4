#pragma once

#include "core/base/steady.hpp"

namespace anchord::api {

/// What the age of a message is measured by: the wall clock may step.
inline std::int64_t steady_us() { return system_steady_clock().now().ns / 1000; }

}  // namespace anchord::api
