#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace anchord::server {

/// Messages between the server and its worker: 4 bytes of length, little endian, then that many of text, or
/// of bytes behind the word that announces them. Over a stream socket whose other end may die at any time.
inline constexpr std::size_t k_max_frame_bytes = std::size_t{512} << 20;

/// False when the other end is gone. Blocks.
bool write_frame(int fd, std::string_view text);

enum class FrameRead { frame, nothing, closed };
/// One whole message. `wait_ms` for its first byte (negative: for ever); once it has begun the rest is
/// awaited.
FrameRead read_frame(int fd, std::string& text, int wait_ms);

}  // namespace anchord::server
