#include "server/runtime/logging.hpp"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "core/base/text.hpp"
#include "core/base/time.hpp"

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
  line.append(word(level)).append(R"(","msg":)");
  append_json_text(line, message);
  for (const auto& [key, value] : fields) {
    append_json_text(line += ',', key);
    append_json_text(line += ':', value);
  }
  line.append("}");
  logger().log(of(level), spdlog::string_view_t(line.data(), line.size()));
}

}  // namespace anchord::server
