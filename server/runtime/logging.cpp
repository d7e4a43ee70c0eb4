#include "server/runtime/logging.hpp"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cstdio>

#include "core/base/time.hpp"
#include "server/http/text.hpp"

namespace anchord::server {
namespace {

spdlog::logger& logger() {
  static const auto instance = [] {
    auto made =
        std::make_shared<spdlog::logger>("anchord", std::make_shared<spdlog::sinks::stdout_sink_mt>());
    made->set_formatter(std::make_unique<spdlog::pattern_formatter>("%v"));
    made->flush_on(spdlog::level::info);
    return made;
  }();
  return *instance;
}

spdlog::level::level_enum of(LogLevel level) {
  switch (level) {
    case LogLevel::debug:
      return spdlog::level::debug;
    case LogLevel::info:
      return spdlog::level::info;
    case LogLevel::warning:
      return spdlog::level::warn;
    case LogLevel::error:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

std::string_view word(LogLevel level) {
  switch (level) {
    case LogLevel::debug:
      return "debug";
    case LogLevel::info:
      return "info";
    case LogLevel::warning:
      return "warning";
    case LogLevel::error:
      return "error";
  }
  return "error";
}

}  // namespace

bool start_logging(std::string_view level) {
  for (const LogLevel known : {LogLevel::debug, LogLevel::info, LogLevel::warning, LogLevel::error}) {
    if (level == word(known)) {
      logger().set_level(of(known));
      return true;
    }
  }
  return false;
}

void log(LogLevel level, std::string_view message, std::initializer_list<LogField> fields) {
  if (!logger().should_log(of(level))) return;
  std::string line = R"({"ts":")" + to_rfc3339(SystemClock().now()) + R"(","level":")";
  line.append(word(level)).append(R"(","msg":")").append(json_escaped(message)).append("\"");
  for (const auto& [key, value] : fields) {
    line.append(",\"").append(json_escaped(key)).append("\":\"").append(json_escaped(value)).append("\"");
  }
  line.append("}");
  logger().log(of(level), spdlog::string_view_t(line.data(), line.size()));
}

std::string json_escaped(std::string_view text) {
  std::string out;
  out.reserve(text.size() + 8);
  const bool utf8 = valid_utf8(text);
  for (const char c : text) {
    const auto u = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out.push_back('\\');
      out.push_back(c);
    } else if (u < 0x20 || u == 0x7f) {
      std::array<char, 8> code{};
      std::snprintf(code.data(), code.size(), "\\u%04x", static_cast<unsigned>(u));
      out.append(code.data());
    } else if (u >= 0x80 && !utf8) {
      out.append("\xef\xbf\xbd");
    } else {
      out.push_back(c);
    }
  }
  return out;
}

}  // namespace anchord::server
