#include "server/http/proxy_header.hpp"

#include <arpa/inet.h>

#include <array>
#include <cstdint>

#include "server/http/text.hpp"

namespace anchord::server {
namespace {

using State = ProxyHeader::State;

constexpr std::string_view k_version_1 = "PROXY ";
constexpr std::string_view k_version_2{"\r\n\r\n\0\r\nQUIT\n", 12};
constexpr std::size_t k_version_1_bytes = 107;  // the longest line with its end
constexpr std::size_t k_fixed_bytes = 16;
/// Addresses and what proxies add (certificates' names, network namespaces); more is none of theirs.
constexpr std::size_t k_version_2_bytes = 4096;

std::uint8_t octet(std::string_view bytes, std::size_t at) { return static_cast<std::uint8_t>(bytes[at]); }

bool is_address(int family, const std::string& text) {
  std::array<std::uint8_t, 16> ignored{};
  return ::inet_pton(family, text.c_str(), ignored.data()) == 1;
}

std::string address_text(int family, std::string_view bytes) {
  std::array<char, INET6_ADDRSTRLEN> out{};
  const char* text = ::inet_ntop(family, bytes.data(), out.data(), out.size());
  return text == nullptr ? std::string() : std::string(text);
}

/// Is `bytes` the beginning of `word`, or `word` that of `bytes`?
bool may_be(std::string_view bytes, std::string_view word) {
  const auto n = std::min(bytes.size(), word.size());
  return bytes.substr(0, n) == word.substr(0, n);
}

ProxyHeader version_1(std::string_view bytes) {
  const auto end = bytes.substr(0, k_version_1_bytes).find("\r\n");
  if (end == std::string_view::npos) return {bytes.size() < k_version_1_bytes ? State::more : State::broken};
  const auto words = split(bytes.substr(0, end), ' ');
  ProxyHeader out{State::whole, end + 2};
  if (words[1] == "UNKNOWN") return out;
  const bool v4 = words[1] == "TCP4";
  if (words.size() != 6 || (!v4 && words[1] != "TCP6")) return {State::broken};
  out.client = std::string(words[2]);
  return is_address(v4 ? AF_INET : AF_INET6, *out.client) ? out : ProxyHeader{State::broken};
}

ProxyHeader version_2(std::string_view bytes) {
  if (bytes.size() < k_fixed_bytes) return {State::more};
  const unsigned command = octet(bytes, 12), family = octet(bytes, 13);
  const std::size_t size = octet(bytes, 14) * 256u + octet(bytes, 15);
  if (command != 0x20 && command != 0x21) return {State::broken};
  if (size > k_version_2_bytes) return {State::broken};
  if (bytes.size() < k_fixed_bytes + size) return {State::more};
  ProxyHeader out{State::whole, k_fixed_bytes + size};
  const auto body = bytes.substr(k_fixed_bytes, size);
  const unsigned network = family >> 4;  // 1: IPv4, 2: IPv6; others are no network of ours
  if (command == 0x20 || network < 1 || network > 2) return out;
  if (body.size() < (network == 1 ? 12u : 36u)) return {State::broken};
  out.client = address_text(network == 1 ? AF_INET : AF_INET6, body);
  return out;
}

}  // namespace

ProxyHeader read_proxy_header(std::string_view bytes) {
  if (bytes.empty()) return {State::more};
  if (may_be(bytes, k_version_2))
    return bytes.size() < k_version_2.size() ? ProxyHeader{State::more} : version_2(bytes);
  if (may_be(bytes, k_version_1))
    return bytes.size() < k_version_1.size() ? ProxyHeader{State::more} : version_1(bytes);
  return {State::none};
}

std::string proxy_header(std::string_view client, std::uint16_t client_port, std::string_view server,
                         std::uint16_t server_port) {
  for (const int family : {AF_INET, AF_INET6}) {
    std::array<char, 16> from{}, to{};
    if (::inet_pton(family, std::string(client).c_str(), from.data()) != 1 ||
        ::inet_pton(family, std::string(server).c_str(), to.data()) != 1)
      continue;
    const std::size_t bytes = family == AF_INET ? 4 : 16;
    std::string out(k_version_2);
    out += '\x21';
    out += family == AF_INET ? '\x11' : '\x21';
    out += '\0';
    out += static_cast<char>(2 * bytes + 4);
    out.append(from.data(), bytes).append(to.data(), bytes);
    for (const auto port : {client_port, server_port}) {
      out += static_cast<char>(port >> 8);
      out += static_cast<char>(port & 0xff);
    }
    return out;
  }
  return {};
}

}  // namespace anchord::server
