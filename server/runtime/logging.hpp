#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace anchord::server {

enum class LogLevel { debug, info, warning, error };
using LogField = std::pair<std::string_view, std::string_view>;

/// Where the log goes (stdout) and from which level; call once, before the threads. Unknown word: false.
bool start_logging(std::string_view level);

/// One JSON object per line: {"ts","level","msg", fields...}. Every text is escaped, so nobody can forge a
/// line or send codes to a terminal. Never hand a token to it. Thread-safe.
void log(LogLevel level, std::string_view message, std::initializer_list<LogField> fields = {});

}  // namespace anchord::server
