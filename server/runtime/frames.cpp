#include "server/runtime/frames.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstdint>

namespace anchord::server {
namespace {

bool write_all(int fd, const char* data, std::size_t n) {
  while (n > 0) {
    const auto done = ::send(fd, data, n, MSG_NOSIGNAL);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return false;
    data += done;
    n -= static_cast<std::size_t>(done);
  }
  return true;
}

bool read_all(int fd, char* data, std::size_t n) {
  while (n > 0) {
    const auto done = ::recv(fd, data, n, 0);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return false;
    data += done;
    n -= static_cast<std::size_t>(done);
  }
  return true;
}

}  // namespace

bool write_frame(int fd, std::string_view text) {
  if (text.size() > k_max_frame_bytes) return false;
  const auto n = static_cast<std::uint32_t>(text.size());
  const std::array<char, 4> head{static_cast<char>(n & 0xff), static_cast<char>(n >> 8 & 0xff),
                                 static_cast<char>(n >> 16 & 0xff), static_cast<char>(n >> 24 & 0xff)};
  return write_all(fd, head.data(), head.size()) && write_all(fd, text.data(), text.size());
}

FrameRead read_frame(int fd, std::string& text, int wait_ms) {
  pollfd one{fd, POLLIN, 0};
  const int ready = ::poll(&one, 1, wait_ms);
  if (ready == 0 || (ready < 0 && errno == EINTR)) return FrameRead::nothing;
  if (ready < 0) return FrameRead::closed;
  std::array<unsigned char, 4> head{};
  if (!read_all(fd, reinterpret_cast<char*>(head.data()), head.size())) return FrameRead::closed;
  const std::size_t n =
      head[0] | std::size_t{head[1]} << 8 | std::size_t{head[2]} << 16 | std::size_t{head[3]} << 24;
  if (n > k_max_frame_bytes) return FrameRead::closed;
  text.resize(n);
  return read_all(fd, text.data(), n) ? FrameRead::frame : FrameRead::closed;
}

}  // namespace anchord::server
