#pragma once

#include <stop_token>
#include <string>
#include <string_view>

#include "api/work/worker_port.hpp"
#include "core/base/result.hpp"

namespace anchord::api {

/// A training run: rows and settings in, the model and the parts of its report out. Pure: no store, no
/// socket. errors: bad_frame (the message), those of the training
Result<std::string> do_training_work(std::string_view message, const std::stop_token& stop,
                                     const WorkProgressSink& progress);

}  // namespace anchord::api
