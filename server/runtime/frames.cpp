#include "server/runtime/frames.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdint>

namespace anchord::server {
namespace {

constexpr int k_ask_every_ms = 50;

bool would_block() { return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR; }

bool write_all(int fd, std::string_view data, const std::function<bool()>& give_up) {
  while (!data.empty()) {
    const auto done = ::send(fd, data.data(), data.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (done > 0) {
      data.remove_prefix(static_cast<std::size_t>(done));
      continue;
    }
    if (done == 0 || !would_block()) return false;
    if (give_up && give_up()) return false;
    pollfd one{fd, POLLOUT, 0};
    (void)::poll(&one, 1, give_up ? k_ask_every_ms : -1);
  }
  return true;
}

/// How much came; 0: nothing is there now. Negative: the other end is gone.
ssize_t take(int fd, char* to, std::size_t most) {
  const auto done = ::recv(fd, to, most, MSG_DONTWAIT);
  if (done > 0) return done;
  return done < 0 && would_block() ? 0 : -1;
}

std::size_t length_of(const std::array<char, 4>& head) {
  std::size_t n = 0;
  for (std::size_t i = 0; i < head.size(); ++i)
    n |= std::size_t{static_cast<unsigned char>(head[i])} << (8 * i);
  return n;
}

}  // namespace

bool write_frame(int fd, std::string_view text, const std::function<bool()>& give_up) {
  if (text.size() > k_max_frame_bytes) return false;
  const auto n = static_cast<std::uint32_t>(text.size());
  const std::array<char, 4> head{static_cast<char>(n & 0xff), static_cast<char>(n >> 8 & 0xff),
                                 static_cast<char>(n >> 16 & 0xff), static_cast<char>(n >> 24 & 0xff)};
  return write_all(fd, {head.data(), head.size()}, give_up) && write_all(fd, text, give_up);
}

FrameRead FrameReader::read(std::string& text, int wait_ms) {
  while (true) {
    const bool in_head = n_head_ < head_.size();
    if (!in_head && n_body_ == body_.size()) {
      text = std::move(body_);
      body_.clear();
      n_head_ = n_body_ = 0;
      return FrameRead::frame;
    }
    const auto n = in_head ? take(fd_, head_.data() + n_head_, head_.size() - n_head_)
                           : take(fd_, body_.data() + n_body_, body_.size() - n_body_);
    if (n < 0) return FrameRead::closed;
    if (n == 0) {
      pollfd one{fd_, POLLIN, 0};
      if (::poll(&one, 1, wait_ms) <= 0 && wait_ms >= 0) return FrameRead::nothing;
      continue;
    }
    (in_head ? n_head_ : n_body_) += static_cast<std::size_t>(n);
    if (!in_head || n_head_ < head_.size()) continue;
    const std::size_t length = length_of(head_);
    if (length > k_max_frame_bytes) return FrameRead::closed;
    body_.resize(length);
  }
}

}  // namespace anchord::server
