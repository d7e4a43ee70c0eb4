#include "drivers/record/event.hpp"

#include <array>
#include <cstring>

namespace anchord::record {
namespace {

/// Castagnoli's polynomial, reflected (RFC 3720, appendix B.4).
constexpr std::array<std::uint32_t, 256> k_table = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1) != 0 ? 0x82F63B78U : 0);
    table[i] = value;
  }
  return table;
}();

template <class T>
void put(std::string& out, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    out += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xFF);
  }
}

template <class T>
T get(std::string_view bytes, std::size_t at) {
  std::uint64_t out = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    out |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[at + i])) << (8 * i);
  }
  return static_cast<T>(out);
}

}  // namespace

std::uint32_t crc32c(std::string_view bytes) {
  std::uint32_t crc = 0xFFFF'FFFFU;
  for (const char c : bytes) crc = (crc >> 8) ^ k_table[(crc ^ static_cast<unsigned char>(c)) & 0xFF];
  return ~crc;
}

void append_record(std::string& out, const Event& event) {
  const auto start = out.size();
  put(out, static_cast<std::uint32_t>(k_body_head + event.payload.size()));
  put(out, std::uint32_t{0});
  put(out, static_cast<std::uint8_t>(event.kind));
  put(out, event.slot);
  put(out, event.at.steady_ns);
  put(out, event.at.utc.ns);
  out += event.payload;
  std::string sum;
  put(sum, crc32c(std::string_view(out).substr(start + k_record_head)));
  out.replace(start + 4, 4, sum);
}

bool EventReader::begin() {
  if (!rest_.starts_with(k_magic)) return false;
  rest_.remove_prefix(k_magic.size());
  return true;
}

std::optional<Event> EventReader::next() {
  if (rest_.size() < k_record_head + k_body_head) return std::nullopt;
  const auto length = get<std::uint32_t>(rest_, 0);
  if (length < k_body_head || length > k_body_head + k_max_payload || length > rest_.size() - k_record_head) {
    return std::nullopt;
  }
  const auto body = rest_.substr(k_record_head, length);
  if (crc32c(body) != get<std::uint32_t>(rest_, 4)) return std::nullopt;
  const auto kind = k_event_kind_words.of_number(get<std::uint8_t>(body, 0));
  if (!kind) return std::nullopt;
  Event event;
  event.kind = *kind;
  event.slot = get<std::uint16_t>(body, 1);
  event.at = {UtcTime{get<std::int64_t>(body, 11)}, get<std::int64_t>(body, 3)};
  event.payload = body.substr(k_body_head);
  rest_.remove_prefix(k_record_head + length);
  return event;
}

}  // namespace anchord::record
