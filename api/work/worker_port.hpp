#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "core/base/result.hpp"

/// Heavy work, apart from the service: a message of text in, a message of text out. The server runs it in a
/// process of its own (server/runtime/worker_process); a test may run it on its own thread.
namespace anchord::api {

struct WorkProgress {
  std::string stage{};
  std::size_t stage_index{}, stage_count{};
  double fraction{};
  std::string detail{};
};
using WorkProgressSink = std::function<void(const WorkProgress&)>;

/// Does what the message asks for. errors: those of the work; canceled; internal (the process died)
/// canceled  asked a few times a second at least
using RunWork = std::function<Result<std::string>(
    const std::string& message, const WorkProgressSink& progress, const std::function<bool()>& canceled)>;

}  // namespace anchord::api
