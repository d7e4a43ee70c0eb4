#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "tests/server/http/raw_socket.hpp"

namespace anchord::test {

/// A WebSocket client of raw frames, so that it can also send wrong ones. RFC 6455 section 5.2.
class WsClient {
 public:
  explicit WsClient(std::uint16_t port, const std::string& target = "/ws", const std::string& headers = "",
                    int receive_buffer = 0)
      : socket(port, receive_buffer) {
    socket.send(
        "GET " + target + " HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n" +
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n" + headers + "\r\n");
    socket.read_until([](const std::string& all) { return all.find("\r\n\r\n") != std::string::npos; });
    const auto end = socket.input.find("\r\n\r\n");
    if (end == std::string::npos) return;
    handshake = socket.input.substr(0, end + 4);
    if (status_of(handshake) == 101) socket.input.erase(0, end + 4);
  }
  bool open() const { return status_of(handshake) == 101; }

  /// opcode: 0 continuation, 1 text, 2 binary, 8 close, 9 ping, 10 pong. The mask is zero: allowed, if
  /// unusual.
  bool send(int opcode, std::string_view payload, bool fin = true, int reserved = 0, bool masked = true) {
    std::string frame;
    frame.push_back(static_cast<char>((fin ? 0x80 : 0) | reserved << 4 | opcode));
    const int mask = masked ? 0x80 : 0;
    if (payload.size() < 126) {
      frame.push_back(static_cast<char>(mask | static_cast<int>(payload.size())));
    } else if (payload.size() < 65'536) {
      frame.push_back(static_cast<char>(mask | 126));
      for (int shift = 8; shift >= 0; shift -= 8) frame.push_back(static_cast<char>(payload.size() >> shift));
    } else {
      frame.push_back(static_cast<char>(mask | 127));
      for (int shift = 56; shift >= 0; shift -= 8)
        frame.push_back(static_cast<char>(payload.size() >> shift));
    }
    if (masked) frame.append(4, '\0');
    frame.append(payload);
    return socket.send(frame);
  }

  struct Frame {
    int opcode{};
    bool fin{};
    std::string payload;
    int close_code() const {
      if (opcode != 8 || payload.size() < 2) return 0;
      return static_cast<unsigned char>(payload[0]) << 8 | static_cast<unsigned char>(payload[1]);
    }
  };
  /// The next frame, or null when the connection ended or the deadline passed.
  std::optional<Frame> frame(std::chrono::milliseconds deadline = std::chrono::seconds(10)) {
    std::size_t at = 0, size = 0;
    const bool whole = socket.read_until(
        [&](const std::string& all) {
          if (all.size() < 2) return false;
          const auto byte = [&](std::size_t i) {
            return static_cast<std::size_t>(static_cast<unsigned char>(all[i]));
          };
          size = byte(1) & 0x7f;
          at = 2;
          const std::size_t more = size == 126 ? 2 : size == 127 ? 8 : 0;
          if (all.size() < at + more) return false;
          if (more > 0) size = 0;
          for (std::size_t i = 0; i < more; ++i) size = size << 8 | byte(at + i);
          at += more;
          return all.size() >= at + size;
        },
        deadline);
    if (!whole) return std::nullopt;
    Frame got{socket.input[0] & 0x0f, (socket.input[0] & 0x80) != 0, socket.input.substr(at, size)};
    socket.input.erase(0, at + size);
    return got;
  }
  /// Close code the server ends with; 0 when it ends without.
  int ended_with(std::chrono::milliseconds deadline = std::chrono::seconds(10)) {
    while (const auto got = frame(deadline)) {
      if (got->opcode == 8) return got->close_code();
    }
    return 0;
  }

  RawSocket socket;
  std::string handshake;
};

}  // namespace anchord::test
