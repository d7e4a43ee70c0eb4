#include "api/admin/support_bundle.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <regex>

namespace anchord::api {
namespace {

constexpr std::size_t k_block = 512;

/// A field of a tar header: octal digits and a zero byte.
void octal(std::array<char, k_block>& header, std::size_t at, std::size_t width, std::uint64_t value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%0*llo", static_cast<int>(width - 1),
                static_cast<unsigned long long>(value));
  std::copy_n(text.data(), width - 1, header.data() + at);
}

std::array<char, k_block> tar_header(const SupportFile& file, UtcTime at) {
  std::array<char, k_block> h{};
  std::copy_n(file.first.data(), std::min<std::size_t>(file.first.size(), 99), h.data());
  octal(h, 100, 8, 0600);
  octal(h, 108, 8, 0);
  octal(h, 116, 8, 0);
  octal(h, 124, 12, file.second.size());
  octal(h, 136, 12, static_cast<std::uint64_t>(std::max<std::int64_t>(0, at.us() / 1'000'000)));
  std::fill_n(h.data() + 148, 8, ' ');  // the checksum counts as spaces while it is summed
  h[156] = '0';
  constexpr std::string_view k_magic("ustar\00000", 8);
  std::copy(k_magic.begin(), k_magic.end(), h.data() + 257);
  std::uint64_t sum = 0;
  for (const char c : h) sum += static_cast<unsigned char>(c);
  octal(h, 148, 7, sum);
  h[154] = '\0';
  return h;
}

}  // namespace

std::string without_secrets(std::string_view text) {
  static const std::regex k_userinfo(R"(://[^/@\s"']+@)");
  static const std::regex k_bearer(R"(([Bb]earer\s+)[A-Za-z0-9._~+/=-]+)");
  static const std::regex k_token(R"([0-9a-fA-F]{64})");
  static const std::regex k_member(
      R"re(("[^"]*(?:password|secret|token|signing_key|api_key)[^"]*"\s*:\s*")[^"]*")re", std::regex::icase);
  std::string out;
  // Line by line: a regex over megabytes recurses deeper than a thread's stack.
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    std::string line(text.substr(from, end - from));
    line = std::regex_replace(line, k_userinfo, "://(left out)@");
    line = std::regex_replace(line, k_bearer, "$1(left out)");
    line = std::regex_replace(line, k_token, "(left out)");
    line = std::regex_replace(line, k_member, "$1(left out)\"");
    out += line;
    if (end < text.size()) out += '\n';
    from = end + 1;
  }
  return out;
}

std::string tar_of(const std::vector<SupportFile>& files, UtcTime at) {
  std::string out;
  for (const auto& file : files) {
    const auto header = tar_header(file, at);
    out.append(header.data(), header.size());
    out += file.second;
    out.append((k_block - file.second.size() % k_block) % k_block, '\0');
  }
  return out.append(2 * k_block, '\0');
}

}  // namespace anchord::api
