#include "server/runtime/logging.hpp"

#include <spdlog/async.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <deque>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/time.hpp"

namespace anchord::server {
namespace {

/// Nobody waits for whoever reads the log: when it is not read, the oldest of so many lines go.
constexpr std::size_t k_waiting_lines = 8192;

const std::shared_ptr<spdlog::details::thread_pool>& writer() {
  static const auto pool = std::make_shared<spdlog::details::thread_pool>(k_waiting_lines, 1);
  return pool;
}

spdlog::logger& logger() {
  static const auto instance = [] {
    auto made =
        std::make_shared<spdlog::async_logger>("anchord", std::make_shared<spdlog::sinks::stdout_sink_mt>(),
                                               writer(), spdlog::async_overflow_policy::overrun_oldest);
    made->set_formatter(std::make_unique<spdlog::pattern_formatter>("%v"));
    made->flush_on(spdlog::level::info);
    return made;
  }();
  return *instance;
}

/// What was logged lately; a line is a few hundred bytes.
constexpr std::size_t k_recent_lines = 2000;
Locked<std::deque<std::string>>& recent() {
  static Locked<std::deque<std::string>> lines;
  return lines;
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

}  // namespace

bool start_logging(std::string_view level) {
  const auto known = k_log_level_words.find(level);
  if (!known) return false;
  logger().set_level(of(*known));
  on_task_failure([](const TaskFailure& failure) {
    log(LogLevel::error, "task failed",
        {{"task", failure.task}, {"what", failure.what}, {"count", std::to_string(failure.count)}});
  });
  return true;
}

std::size_t lost_log_lines() { return writer()->overrun_counter(); }

bool logs(LogLevel level) { return logger().should_log(of(level)); }

void log(LogLevel level, std::string_view message, std::initializer_list<LogField> fields) {
  if (!logs(level)) return;
  const std::string line = log_line(SystemClock().now(), level, message, fields);
  logger().log(of(level), spdlog::string_view_t(line.data(), line.size()));
  auto lines = recent().lock();
  lines->push_back(line);
  if (lines->size() > k_recent_lines) lines->pop_front();
}

std::string recent_log() {
  const auto lines = recent().lock();
  std::string out;
  for (const auto& line : *lines) out += line + '\n';
  return out;
}

}  // namespace anchord::server
