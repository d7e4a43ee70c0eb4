#include "server/runtime/log_line.hpp"

#include "core/base/text.hpp"

namespace anchord::server {

std::string log_line(UtcTime now, LogLevel level, std::string_view message,
                     std::initializer_list<LogField> fields) {
  std::string line = R"({"ts":")" + to_rfc3339(now) + R"(","level":")";
  line.append(k_log_level_words.word(level)).append(R"(","msg":)");
  append_json_text(line, message);
  for (const auto& [key, value] : fields) {
    append_json_text(line += ',', key);
    append_json_text(line += ':', value);
  }
  line.append("}");
  return line;
}

}  // namespace anchord::server
