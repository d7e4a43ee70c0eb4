#include "server/config/toml_json.hpp"

#include <toml++/toml.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/base/to_wire.hpp"

namespace anchord::server {
namespace {

constexpr std::size_t k_most_bytes = 64 * 1024;

}  // namespace

Result<std::string> read_as_json(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return make_error(Errc::not_found, file.string() + " cannot be read");
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  if (text.size() > k_most_bytes)
    return make_error(Errc::invalid_argument, file.string() + " has " + std::to_string(text.size()) +
                                                  " bytes (at most " + std::to_string(k_most_bytes) + ")");
  if (file.extension() != ".toml") {
    // The parser's own words name the place; without exceptions it has none.
    try {
      return to_wire(nlohmann::json::parse(text));
    } catch (const nlohmann::json::exception& error) {
      return make_error(Errc::invalid_argument, file.string() + ": " + error.what());
    }
  }
  try {
    std::ostringstream out;
    out << toml::json_formatter{toml::parse(text)};
    return out.str();
  } catch (const toml::parse_error& error) {
    std::ostringstream what;
    what << file.string() << ":" << error.source().begin.line << ":" << error.source().begin.column << ": "
         << error.description();
    return make_error(Errc::invalid_argument, what.str());
  }
}

}  // namespace anchord::server
