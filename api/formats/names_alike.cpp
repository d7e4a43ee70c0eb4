#include "api/formats/names_alike.hpp"

#include <map>
#include <set>

#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_warnings = 20, k_most_letters = 60;

std::string plain(const std::string& name) {
  std::string out;
  for (const char c : name)
    if (c >= 'A' && c <= 'Z')
      out += static_cast<char>(c - 'A' + 'a');
    else if (c != ' ' && c != '\t')
      out += c;
  return out;
}

}  // namespace

std::vector<std::string> names_alike(const std::string& what, std::span<const std::string> names) {
  std::map<std::string, std::set<std::string>> alike;
  for (const auto& name : names)
    if (!name.empty()) alike[plain(name)].insert(name);
  std::vector<std::string> out;
  for (const auto& [word, spellings] : alike) {
    if (spellings.size() < 2 || out.size() == k_most_warnings) continue;
    std::string text;
    for (const auto& name : spellings)
      text += (text.empty() ? "" : ", ") + ('"' + to_utf8(name, k_most_letters) + '"');
    out.push_back(what + " that differ in capitals or blanks alone are apart: " + text +
                  "; give them one name if they are one");
  }
  return out;
}

}  // namespace anchord::api
