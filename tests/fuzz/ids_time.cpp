// Identifiers and times from text: what is accepted must survive being written and read again.
#include <cstdint>
#include <string_view>

#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "tests/fuzz/check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto id = parse_uuid(text)) {
    fuzz::require(text.size() == 36, "only the canonical length is a UUID");
    fuzz::require(parse_uuid(to_string(id.value())).value() == id.value(), "a UUID reads back");
  }
  if (const auto id = parse_network_id(text)) {
    fuzz::require(parse_network_id(to_string(id.value())).value() == id.value(), "a network id reads back");
  }
  if (const auto time = parse_rfc3339(text)) {
    const UtcTime whole = UtcTime::from_us(time.value().us());
    const auto again = parse_rfc3339(to_rfc3339(whole));
    fuzz::require(again && again.value() == whole, "a time reads back");
  }
  return 0;
}
