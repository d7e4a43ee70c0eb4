#pragma once

#include <cstdio>
#include <cstdlib>

namespace anchord::fuzz {

/// A property that must hold for every input: the fuzzer keeps the input that breaks it.
inline void require(bool holds, const char* property) {
  if (holds) return;
  std::fprintf(stderr, "property broken: %s\n", property);
  std::abort();
}

}  // namespace anchord::fuzz
