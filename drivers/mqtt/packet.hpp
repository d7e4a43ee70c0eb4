#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord::mqtt {

/// MQTT 3.1.1 (OASIS, 29 October 2014), section 2.2.1.
enum class PacketType : std::uint8_t {
  connect = 1,
  connack = 2,
  publish = 3,
  puback = 4,
  subscribe = 8,
  suback = 9,
  pingreq = 12,
  pingresp = 13,
  disconnect = 14,
};

struct Packet {
  PacketType type{};
  std::uint8_t flags{};
  std::string_view body;  ///< valid during the call only
};

struct Message {
  std::string_view topic, payload;
  int qos{};
  bool retained{};
  std::uint16_t id{};  ///< of qos 1 and 2
};
/// errors: bad_frame
Result<Message> message_of(const Packet& packet);

struct Login {
  std::string client_id, user;
  std::optional<std::string> password{};
  std::uint16_t keep_alive_s{};
};
std::string connect_packet(const Login& login);
/// At QoS 0: what is lost on the way is followed by newer ranges.
std::string subscribe_packet(std::uint16_t id, std::string_view filter);
std::string puback_packet(std::uint16_t id);
std::string ping_packet();
std::string disconnect_packet();

/// Packets out of bytes in any cut. Holds at most `most` bytes: larger messages are skipped as they come, and
/// told; other packets of that size are an error. Pure.
class PacketReader {
 public:
  explicit PacketReader(std::size_t most) : most_(most) {}
  void clear();
  /// errors: bad_frame, after which the connection is of no use
  Result<void> take(std::string_view bytes, const std::function<void(const Packet&)>& packet,
                    const std::function<void()>& skipped);

 private:
  std::size_t most_;
  std::string held_;  ///< the packet that has begun, from its first byte
  std::size_t skip_{0};
};

}  // namespace anchord::mqtt
