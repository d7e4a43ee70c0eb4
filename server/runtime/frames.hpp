#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace anchord::server {

/// Messages between the server and its worker: 4 bytes of length, little endian, then that many of text, or
/// of bytes behind the word that announces them. Over a stream socket whose other end may die, or stand still
/// in the middle of a message, at any time.
inline constexpr std::size_t k_max_frame_bytes = std::size_t{512} << 20;

/// False when the other end is gone, or when `give_up`, asked some times a second while the other end takes
/// nothing, said so. Without it, waits for ever.
bool write_frame(int fd, std::string_view text, const std::function<bool()>& give_up = nullptr);

enum class FrameRead { frame, nothing, closed };

/// Reads one socket. What has come of a message stays until the rest comes.
class FrameReader {
 public:
  explicit FrameReader(int fd) : fd_(fd) {}
  /// One whole message, or nothing after `wait_ms` without a byte (negative: waits for ever).
  FrameRead read(std::string& text, int wait_ms);

 private:
  int fd_;
  std::array<char, 4> head_{};
  std::size_t n_head_{0}, n_body_{0};
  std::string body_;
};

}  // namespace anchord::server
