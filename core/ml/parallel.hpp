#pragma once

#include <cstddef>
#include <functional>
#include <stop_token>

#include "core/base/result.hpp"

namespace anchord::ml {

/// How a long computation runs: how wide, and whether it is still wanted.
struct Execution {
  std::size_t threads{1};  ///< 0: as many as cores
  std::stop_token stop{};

  bool cancelled() const { return stop.stop_requested(); }
};

/// Calls work(0) .. work(n - 1), each once, on up to `threads` threads; whoever is free takes the next. Each
/// call must write to places of its own, so that the outcome does not depend on the order.
/// errors  that of the lowest index that failed; canceled where a stop was asked for. An exception of `work`
///         is thrown again on the calling thread.
Result<void> parallel_for(std::size_t n, const Execution& how,
                          const std::function<Result<void>(std::size_t)>& work);

}  // namespace anchord::ml
