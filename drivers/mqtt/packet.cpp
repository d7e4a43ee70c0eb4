#include "drivers/mqtt/packet.hpp"

#include <algorithm>

namespace anchord::mqtt {
namespace {

constexpr std::size_t k_most_text = 65'535;

void append_u16(std::string& out, std::size_t value) {
  out += static_cast<char>(value >> 8 & 0xff);
  out += static_cast<char>(value & 0xff);
}
void append_text(std::string& out, std::string_view text) {
  text = text.substr(0, k_most_text);
  append_u16(out, text.size());
  out += text;
}
std::uint16_t u16(std::string_view bytes) {
  return static_cast<std::uint16_t>(static_cast<unsigned char>(bytes[0]) << 8 |
                                    static_cast<unsigned char>(bytes[1]));
}

/// Section 2.2.3: seven bits a byte, the least first.
std::string packet(PacketType type, std::uint8_t flags, std::string_view body) {
  std::string out(1, static_cast<char>(static_cast<unsigned>(type) << 4 | flags));
  std::size_t left = body.size();
  do {
    const auto low = static_cast<unsigned char>(left & 0x7f);
    left >>= 7;
    out += static_cast<char>(left > 0 ? low | 0x80 : low);
  } while (left > 0);
  out += body;
  return out;
}

struct Head {
  std::size_t bytes{}, body{};
};
/// Nothing: not whole yet. errors: bad_frame
Result<std::optional<Head>> head_of(std::string_view held) {
  Head out{1, 0};
  for (int shift = 0;; shift += 7) {
    if (shift > 21) return make_error(Errc::bad_frame, "a length of more than four bytes: this is not MQTT");
    if (out.bytes >= held.size()) return std::optional<Head>{};
    const auto byte = static_cast<unsigned char>(held[out.bytes++]);
    out.body |= static_cast<std::size_t>(byte & 0x7f) << shift;
    if ((byte & 0x80) == 0) return std::optional(out);
  }
}

}  // namespace

Result<Message> message_of(const Packet& packet) {
  const auto bad = [](const char* why) { return make_error(Errc::bad_frame, why); };
  Message out;
  out.qos = packet.flags >> 1 & 3;
  out.retained = (packet.flags & 1) != 0;
  if (out.qos == 3) return bad("a message of QoS 3");
  auto rest = packet.body;
  if (rest.size() < 2) return bad("a message without a topic");
  const std::size_t length = u16(rest);
  rest.remove_prefix(2);
  if (length == 0 || rest.size() < length) return bad("a topic that is longer than its message, or empty");
  out.topic = rest.substr(0, length);
  rest.remove_prefix(length);
  if (out.qos > 0) {
    if (rest.size() < 2) return bad("a message of QoS 1 without its number");
    out.id = u16(rest);
    rest.remove_prefix(2);
  }
  out.payload = rest;
  return out;
}

// Section 3.1.
std::string connect_packet(const Login& login) {
  std::string body;
  append_text(body, "MQTT");
  body += '\x04';         // 3.1.1
  unsigned flags = 0x02;  // a clean session: nothing waits for us at the broker
  if (!login.user.empty()) flags |= 0x80;
  if (!login.user.empty() && login.password) flags |= 0x40;
  body += static_cast<char>(flags);
  append_u16(body, login.keep_alive_s);
  append_text(body, login.client_id);
  if (!login.user.empty()) append_text(body, login.user);
  if (!login.user.empty() && login.password) append_text(body, *login.password);
  return packet(PacketType::connect, 0, body);
}

std::string subscribe_packet(std::uint16_t id, std::string_view filter) {
  std::string body;
  append_u16(body, id);
  append_text(body, filter);
  body += '\0';
  return packet(PacketType::subscribe, 2, body);
}

std::string puback_packet(std::uint16_t id) {
  std::string body;
  append_u16(body, id);
  return packet(PacketType::puback, 0, body);
}

std::string ping_packet() { return packet(PacketType::pingreq, 0, {}); }
std::string disconnect_packet() { return packet(PacketType::disconnect, 0, {}); }

void PacketReader::clear() {
  held_.clear();
  skip_ = 0;
}

Result<void> PacketReader::take(std::string_view bytes, const std::function<void(const Packet&)>& packet,
                                const std::function<void()>& skipped) {
  while (!bytes.empty()) {
    if (skip_ > 0) {
      const auto n = std::min(skip_, bytes.size());
      bytes.remove_prefix(n);
      skip_ -= n;
      continue;
    }
    // The head first, a byte at a time: at most five.
    BOOST_OUTCOME_TRY(auto head, head_of(held_));
    if (!head) {
      held_ += bytes.front();
      bytes.remove_prefix(1);
      BOOST_OUTCOME_TRY(head, head_of(held_));
      if (!head) continue;
    }
    const auto type = static_cast<PacketType>(static_cast<unsigned char>(held_[0]) >> 4);
    const std::size_t whole = head->bytes + head->body;
    if (head->body > most_) {
      if (type != PacketType::publish)
        return make_error(Errc::bad_frame,
                          "a packet of " + std::to_string(head->body) + " bytes that is not a message");
      skip_ = head->body;
      held_.clear();
      skipped();
      continue;
    }
    const auto n = std::min(whole - held_.size(), bytes.size());
    held_ += bytes.substr(0, n);
    bytes.remove_prefix(n);
    if (held_.size() < whole) return boost::outcome_v2::success();
    const std::string one = std::exchange(held_, {});
    packet({type, static_cast<std::uint8_t>(one[0] & 0x0f), std::string_view(one).substr(head->bytes)});
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::mqtt
