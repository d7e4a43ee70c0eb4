#include "api/formats/csv_text.hpp"

namespace anchord::api {

std::string csv_text(std::string_view text) {
  std::string out;
  // Spreadsheets run cells that begin like a formula (reliability.md section 5).
  if (!text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos) out += '\'';
  out += text;
  if (out.find_first_of(",\"\r\n") == std::string::npos) return out;
  std::string quoted = "\"";
  for (const char c : out) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

}  // namespace anchord::api
