#include "server/app/proxies.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <charconv>

#include "server/http/text.hpp"

namespace anchord::server {

/// IPv4 as the IPv6 address that it maps to, so that one comparison serves both.
bool TrustedProxies::read(std::string_view text, Bytes& out) {
  if (text.starts_with('[') && text.ends_with(']')) text = text.substr(1, text.size() - 2);
  const std::string word(text);
  std::array<std::uint8_t, 4> v4{};
  if (::inet_pton(AF_INET, word.c_str(), v4.data()) == 1) {
    out = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, v4[0], v4[1], v4[2], v4[3]};
    return true;
  }
  return ::inet_pton(AF_INET6, word.c_str(), out.data()) == 1;
}

Result<TrustedProxies> TrustedProxies::parse(const std::vector<std::string>& entries) {
  TrustedProxies out;
  for (const auto& entry : entries) {
    const auto slash = entry.find('/');
    Network network;
    const bool good = read(std::string_view(entry).substr(0, slash), network.address);
    const bool v4 = entry.find(':') == std::string::npos;
    unsigned bits = v4 ? 32 : 128;
    bool sized = true;
    if (slash != std::string::npos) {
      const auto* end = entry.data() + entry.size();
      const auto [at, error] = std::from_chars(entry.data() + slash + 1, end, bits);
      sized = error == std::errc{} && at == end && bits <= (v4 ? 32u : 128u);
    }
    if (!good || !sized)
      return make_error(Errc::invalid_argument,
                        "trusted_proxies: '" + entry + "' is not an address or network like 10.0.0.0/8");
    network.bits = v4 ? 96 + bits : bits;
    out.networks_.push_back(network);
  }
  return out;
}

bool TrustedProxies::trusts(std::string_view address) const {
  Bytes bytes{};
  if (networks_.empty() || !read(address, bytes)) return false;
  return std::ranges::any_of(networks_, [&](const Network& network) {
    for (unsigned bit = 0; bit < network.bits; ++bit) {
      const auto mask = static_cast<std::uint8_t>(0x80u >> bit % 8);
      if (((bytes[bit / 8] ^ network.address[bit / 8]) & mask) != 0) return false;
    }
    return true;
  });
}

std::string TrustedProxies::client(std::string_view peer, std::string_view forwarded_for) const {
  std::string who(peer);
  if (!trusts(peer)) return who;
  const auto hops = split(forwarded_for, ',');
  for (auto hop = hops.rbegin(); hop != hops.rend(); ++hop) {
    Bytes bytes{};
    const auto address = trim(*hop);
    if (!read(address, bytes)) break;  // what is not an address was not written by a proxy of ours
    who = std::string(address);
    if (!trusts(address)) break;
  }
  return who;
}

}  // namespace anchord::server
