#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>

// Vectors pass between functions here, all of which are inlined; nobody else sees how.
#pragma GCC diagnostic ignored "-Wpsabi"

#define ANCHORD_INLINE inline __attribute__((always_inline))

namespace anchord::lanes {

inline constexpr std::size_t k_lanes = 4;
/// Four doubles and the arithmetic of one: two SSE2 registers or one of AVX2, the same operations in either.
using Four = double __attribute__((vector_size(k_lanes * sizeof(double))));

ANCHORD_INLINE Four load(const double* from) {
  Four out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
ANCHORD_INLINE void store(double* to, Four value) { std::memcpy(to, &value, sizeof value); }
ANCHORD_INLINE Four root(Four a) {
  Four out;
  for (std::size_t i = 0; i < k_lanes; ++i) out[i] = __builtin_sqrt(a[i]);
  return out;
}

}  // namespace anchord::lanes
