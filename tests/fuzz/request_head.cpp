// Bytes as a client may send them: scanned, parsed, judged and decoded as in a connection.
#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "server/http/request_check.hpp"
#include "server/http/request_parser.hpp"
#include "server/http/target.hpp"
#include "tests/fuzz/check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  using namespace anchord::server;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  static const HttpLimits limits;
  static const HostPolicy policy{{"localhost", "127.0.0.1"}, {}};
  const auto target = split_target(bytes, 64);
  if (const auto* good = std::get_if<Target>(&target)) {
    fuzz::require(good->path.find("/../") == std::string::npos, "a path does not climb");
    fuzz::require(good->path.find('\0') == std::string::npos, "a path has no zero byte");
  }
  const auto scan = scan_head(bytes, {}, limits);
  const auto* head = std::get_if<HeadScan>(&scan);
  if (!head || head->head_end == 0) return 0;
  fuzz::require(head->head_end <= size, "a head ends inside the input");
  RequestParser parser(limits);
  const std::string raw(bytes.substr(0, head->head_end));
  if (parser.parse_head(raw)) return 0;
  const HeadCheck judgement = validate_head(parser.head(), limits, policy);
  const auto* good = std::get_if<ValidHead>(&judgement);
  if (!good) return 0;
  std::string_view rest = bytes.substr(head->head_end);
  std::array<char, 64> out{};  // small: many steps
  while (!parser.done()) {
    const auto step = parser.decode(rest, out);
    fuzz::require(step.consumed <= rest.size() && step.produced <= out.size(),
                  "a step stays inside its buffers");
    if (step.refusal || step.done || (step.consumed == 0 && step.produced == 0)) break;
    rest.remove_prefix(step.consumed);
    if (step.needs_input && rest.empty()) break;
  }
  return 0;
}
