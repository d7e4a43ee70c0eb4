#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

#include "api/work/worker_port.hpp"

namespace anchord::api {

/// The work that a message asks for, whichever it is, on the calling thread; not that on pictures of plans.
/// Pure: no store, no socket. errors: bad_frame (the message), those of the work
Result<std::string> do_work(std::string_view message, const std::stop_token& stop,
                            const WorkProgressSink& progress);

/// do_work as a RunWork.
Result<std::string> work_inline(const std::string& message, const WorkProgressSink& progress,
                                const std::function<bool()>& canceled);

}  // namespace anchord::api
