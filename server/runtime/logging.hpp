#pragma once

#include <string_view>

#include "server/runtime/log_line.hpp"

namespace anchord::server {

/// Where the log goes (stdout) and from which level; tasks that fail are told there from now on. Call once,
/// before the threads. Unknown word: false.
bool start_logging(std::string_view level);

/// A log_line. Never hand a token to it. Thread-safe.
void log(LogLevel level, std::string_view message, std::initializer_list<LogField> fields = {});

}  // namespace anchord::server
