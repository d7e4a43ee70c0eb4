#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/enum_table.hpp"
#include "core/base/time.hpp"

namespace anchord::server {

enum class LogLevel { debug, info, warning, error };
inline constexpr auto k_log_level_words = enum_table<LogLevel>({{"debug", LogLevel::debug},
                                                                {"info", LogLevel::info},
                                                                {"warning", LogLevel::warning},
                                                                {"error", LogLevel::error}});
using LogField = std::pair<std::string_view, std::string_view>;

/// One JSON object on one line: {"ts","level","msg", fields...}. Every text is escaped and made UTF-8, so
/// nobody can forge a line or send codes to a terminal.
std::string log_line(UtcTime now, LogLevel level, std::string_view message,
                     std::initializer_list<LogField> fields = {});

}  // namespace anchord::server
