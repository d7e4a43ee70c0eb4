#include "server/runtime/token_file.hpp"

#include <fstream>
#include <nlohmann/json.hpp>

namespace anchord::server {

Result<std::string> token_in(const std::filesystem::path& file) {
  constexpr std::size_t k_most_bytes = 65'536;  // a token and what is known of it are some hundred
  std::ifstream in(file, std::ios::binary);
  std::string text(k_most_bytes, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  constexpr const char* k_blank = " \t\r\n";
  const auto begin = text.find_first_not_of(k_blank);
  if (begin == std::string::npos)
    return make_error(Errc::invalid_argument, file.string() + ": no access token in this file");
  if (text[begin] != '{') return text.substr(begin, text.find_first_of(k_blank, begin) - begin);
  const auto made = nlohmann::json::parse(text, nullptr, false);
  const auto token = made.is_object() ? made.find("token") : made.end();
  if (token == made.end() || !token->is_string() || token->get_ref<const std::string&>().empty())
    return make_error(Errc::invalid_argument,
                      file.string() +
                          ": no access token in this file: it is neither a token nor what "
                          "'anchord token create' prints");
  return token->get<std::string>();
}

}  // namespace anchord::server
