#include "server/http/public_address.hpp"

#include <arpa/inet.h>

#include <array>
#include <cstdint>
#include <string>

namespace anchord::server {
namespace {

struct Block {
  std::uint32_t base;
  int bits;
};
// IANA IPv4 Special-Purpose Address Registry, and multicast.
constexpr std::array k_kept{Block{0x00000000, 8},  Block{0x0a000000, 8},  Block{0x64400000, 10},
                            Block{0x7f000000, 8},  Block{0xa9fe0000, 16}, Block{0xac100000, 12},
                            Block{0xc0000000, 24}, Block{0xc0000200, 24}, Block{0xc0586300, 24},
                            Block{0xc0a80000, 16}, Block{0xc6120000, 15}, Block{0xc6336400, 24},
                            Block{0xcb007100, 24}, Block{0xe0000000, 3}};

bool public_v4(std::uint32_t address) {
  for (const auto& block : k_kept) {
    if (((address ^ block.base) >> (32 - block.bits)) == 0) return false;
  }
  return true;
}

}  // namespace

bool is_public_address(std::string_view address) {
  const std::string text(address);
  in_addr v4{};
  if (inet_pton(AF_INET, text.c_str(), &v4) == 1) return public_v4(ntohl(v4.s_addr));
  in6_addr v6{};
  if (inet_pton(AF_INET6, text.c_str(), &v6) != 1) return false;
  const auto* b = v6.s6_addr;
  const auto word = [&](int i) { return static_cast<std::uint32_t>(b[2 * i] << 8 | b[2 * i + 1]); };
  const auto last_32 = word(6) << 16 | word(7);
  const bool mapped =
      word(0) == 0 && word(1) == 0 && word(2) == 0 && word(3) == 0 && word(4) == 0 && word(5) == 0xffff;
  if (mapped) return public_v4(last_32);
  if ((word(0) & 0xe000) != 0x2000) return false;            // 2000::/3 is all of global unicast there is
  if (word(0) == 0x2001 && word(1) < 0x0200) return false;   // 2001::/23: Teredo, ORCHID, benchmarking
  if (word(0) == 0x2001 && word(1) == 0x0db8) return false;  // documentation
  if (word(0) == 0x2002) return false;                       // 6to4: any IPv4 address inside
  if (word(0) == 0x3fff && word(1) < 0x1000) return false;   // documentation, RFC 9637
  return true;
}

}  // namespace anchord::server
