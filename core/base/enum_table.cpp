#include "core/base/enum_table.hpp"

#include "core/base/text.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_most_shown = 60;

}  // namespace

std::string list_of(std::span<const std::string_view> words) {
  std::string out;
  for (const auto word : words) out.append(out.empty() ? "" : ", ").append(word);
  return out;
}

Error unknown_word(std::string_view name, std::string_view word, std::span<const std::string_view> words) {
  return make_error(Errc::invalid_argument, "unknown " + std::string(name) + " \"" +
                                                to_utf8(word, k_most_shown) + "\": must be one of " +
                                                list_of(words));
}

}  // namespace anchord
