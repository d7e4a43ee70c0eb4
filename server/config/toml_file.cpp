#include "server/config/toml_file.hpp"

#include <toml++/toml.h>

#include <fstream>
#include <sstream>

namespace anchord::server {
namespace {

std::string text_of(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  std::ostringstream out;
  if (const auto* array = node.as_array()) {
    for (const auto& item : *array) out << (out.tellp() > 0 ? "," : "") << text_of(item);
  }
  if (const auto* whole = node.as_integer()) out << whole->get();
  if (const auto* real = node.as_floating_point()) out << real->get();
  if (const auto* yes = node.as_boolean()) out << (yes->get() ? "true" : "false");
  return out.str();
}

void flatten(const toml::table& table, const std::string& prefix, std::map<std::string, std::string>& out) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (const auto* inner = node.as_table()) {
      flatten(*inner, key + ".", out);
    } else {
      out[key] = text_of(node);
    }
  }
}

}  // namespace

Result<std::map<std::string, std::string>> read_toml(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) return make_error(Errc::not_found, "configuration file " + file.string() + " cannot be read");
  std::ostringstream text;
  text << in.rdbuf();
  std::map<std::string, std::string> out;
  try {
    flatten(toml::parse(text.str()), "", out);
  } catch (const toml::parse_error& error) {
    std::ostringstream what;
    what << file.string() << ":" << error.source().begin.line << ":" << error.source().begin.column << ": "
         << error.description();
    return make_error(Errc::invalid_argument, what.str());
  }
  return out;
}

}  // namespace anchord::server
