#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace anchord::server {

/// Every bound of the transport in one place. Defaults are the promises of the documentation; tests shorten
/// times.
struct HttpLimits {
  std::size_t max_connections{4096};  ///< beyond: the oldest idle one goes; when none is idle, 503 and close
  std::size_t max_per_address{1024};  ///< the same of one address
  std::size_t request_line_bytes{8 * 1024};  ///< beyond: 414
  std::size_t head_bytes{16 * 1024};         ///< beyond: 431
  std::size_t headers{100};                  ///< beyond: 431
  std::size_t query_parameters{64};          ///< beyond: 400
  std::size_t chunk_extension_bytes{1024};   ///< over one request; beyond: 400
  std::size_t drain_bytes{64 * 1024};        ///< body of a refused request still read to keep the connection
  std::size_t read_buffer_bytes{64 * 1024};  ///< reserved before a body: small reads cost twice the CPU
  std::size_t body_pipe_bytes{256 * 1024};   ///< between socket and a handler that streams
  std::size_t gzip_from_bytes{1024};
  std::size_t heavy_per_token{8};                ///< computations of one token that wait or run; beyond: 429
  std::chrono::milliseconds keep_alive{75'000};  ///< idle between requests
  std::chrono::milliseconds head_time{10'000};   ///< first byte to last byte of a head
  std::chrono::milliseconds tls_handshake{10'000};  ///< from the connection to its keys
  std::chrono::milliseconds body_window{20'000};    ///< a body may fall behind its floor rate by this much
  std::uint64_t body_floor_bytes_per_s{1024};
  std::chrono::milliseconds write_stall{30'000};  ///< a write without progress
  std::chrono::milliseconds linger{2'000};        ///< after a refusal: time for the peer to read it
};

struct WsLimits {
  std::size_t message_bytes{64 * 1024};  ///< inbound; beyond: close 1009
  std::size_t max_fragments{4096};       ///< of one message; beyond: close 1009
  std::chrono::milliseconds ping{15'000};
  std::chrono::milliseconds idle{45'000};  ///< nothing from the peer, not even a pong
  std::chrono::milliseconds write_stall{30'000};
  std::chrono::milliseconds close_time{5'000};  ///< for the peer to answer a close frame
};

/// Names this server answers to and pages it lets in.
struct HostPolicy {
  std::vector<std::string> hosts;    ///< lower case, without port: "localhost", "127.0.0.1", "[::1]"
  std::vector<std::string> origins;  ///< besides the page's own: "https://portal.example"
};

}  // namespace anchord::server
