#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "server/runtime/log_line.hpp"

namespace anchord::server {

/// Where the log goes (stdout) and from which level; tasks that fail are told there from now on. Call once,
/// before the threads. Unknown word: false.
bool start_logging(std::string_view level);

/// Whether such a line is written at all, for who would gather its fields in vain. Thread-safe.
bool logs(LogLevel level);
/// A log_line. Never hand a token to it. Never waits for whoever reads it: the oldest of 8192 unread lines is
/// lost. Thread-safe.
void log(LogLevel level, std::string_view message, std::initializer_list<LogField> fields = {});
std::size_t lost_log_lines();
/// The last 2000 lines, one below the other: what a support bundle shows. Thread-safe.
std::string recent_log();

}  // namespace anchord::server
