#include "api/formats/area_kind.hpp"

#include <array>
#include <string>
#include <utility>

namespace anchord::api {
namespace {

struct Word {
  std::string_view text;
  AreaKind kind;
};
/// Those that free text may hold come first, in the order in which they are looked for.
constexpr std::array k_words{Word{"nofly", AreaKind::no_fly},     Word{"fence", AreaKind::fence},
                             Word{"outline", AreaKind::outline},  Word{"building", AreaKind::outline},
                             Word{"transit", AreaKind::transit},  Word{"waypoint", AreaKind::waypoint},
                             Word{"path", AreaKind::path},        Word{"geofence", AreaKind::fence},
                             Word{"noflyzone", AreaKind::no_fly}, Word{"noflyarea", AreaKind::no_fly},
                             Word{"exclusion", AreaKind::no_fly}, Word{"inclusion", AreaKind::fence}};
constexpr std::size_t k_n_in_text = 5;

/// "No-fly zone" -> "noflyzone"
std::string squeezed(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c >= 'A' && c <= 'Z')
      out += static_cast<char>(c - 'A' + 'a');
    else if (c != ' ' && c != '_' && c != '-' && c != '\t')
      out += c;
  }
  return out;
}

}  // namespace

std::optional<AreaKind> area_kind(std::string_view word) {
  const auto plain = squeezed(word);
  for (const auto& known : k_words)
    if (plain == known.text) return known.kind;
  return std::nullopt;
}

std::optional<AreaKind> area_kind_in(std::string_view text) {
  const auto plain = squeezed(text);
  for (std::size_t i = 0; i < k_n_in_text; ++i)
    if (plain.find(k_words[i].text) != std::string::npos) return k_words[i].kind;
  return std::nullopt;
}

}  // namespace anchord::api
