#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

/// The lines on the USB serial port, both directions. Pure. pozyx-serial.md sections 1 and 2.
namespace anchord::pozyx {

using Bytes = std::vector<std::uint8_t>;
using ByteView = std::span<const std::uint8_t>;

inline constexpr std::size_t k_chunk = 28;       ///< of one R or W line: longer blocks are split
inline constexpr std::size_t k_max_line = 1024;  ///< longest legal line is 396; more is noise

std::string read_line(std::uint8_t address, std::size_t n);
std::string write_line(std::uint8_t address, ByteView data);
/// reply_bytes  status byte and result bytes together
std::string function_line(std::uint8_t address, ByteView parameters, std::size_t reply_bytes);

/// Bytes of "D,<2n hex digits>"; either case. errors: bad_frame (another text, odd or other number of
/// digits: a late answer of another question, or a function that refused)
Result<Bytes> parse_reply(std::string_view line, std::size_t expected_bytes);

/// One stretch of a block, as the public clients cut it.
struct Chunk {
  std::uint8_t address{};
  std::size_t offset{}, size{};
};
std::vector<Chunk> chunks(std::uint8_t address, std::size_t size);

/// What a tag hears.
struct Command {
  enum class Kind : std::uint8_t { read, write, function };
  Kind kind{};
  std::uint8_t address{};
  std::size_t count{};  ///< bytes asked for (read, function)
  Bytes data{};         ///< written, or parameters
};
/// errors: bad_frame; addresses in one or two hex digits, counts in decimal up to 255
Result<Command> parse_command(std::string_view line);
std::string reply_line(ByteView data);

/// Cuts a stream into lines; empty ones are left out. A line longer than k_max_line is dropped as a whole and
/// counted, so that noise cannot make it grow.
class Lines {
 public:
  /// What ends a line. A host takes CR, LF or both. A tag is told to end commands with CR alone: an LF is
  /// borne where it stands before a command, as terminals send it after a CR, and is noise in the middle of
  /// one.
  enum class End : std::uint8_t { either, carriage_return };
  explicit Lines(End end = End::either) : end_(end) {}
  void feed(std::string_view bytes);
  std::optional<std::string> next();
  void clear();
  bool in_line() const { return !partial_.empty() || skipping_; }
  std::uint64_t dropped_bytes() const { return dropped_; }

 private:
  End end_;
  std::string partial_;
  std::vector<std::string> lines_;
  std::size_t at_{0};
  bool skipping_{false};
  std::uint64_t dropped_{0};
};

std::string hex(ByteView data);
/// Pairs of hex digits, either case. errors: bad_frame
Result<Bytes> unhex(std::string_view text);

// Little endian.
std::uint16_t u16_at(ByteView data, std::size_t at);
std::int16_t i16_at(ByteView data, std::size_t at);
std::uint32_t u32_at(ByteView data, std::size_t at);
std::int32_t i32_at(ByteView data, std::size_t at);
void put_u16(Bytes& out, std::uint16_t value);
void put_u32(Bytes& out, std::uint32_t value);

}  // namespace anchord::pozyx
