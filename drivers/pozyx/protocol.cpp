#include "drivers/pozyx/protocol.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

#include "drivers/pozyx/registers.hpp"

namespace anchord::pozyx {
namespace {

constexpr std::string_view k_digits = "0123456789abcdef";

int nibble(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string hex_byte(std::uint8_t byte) { return {k_digits[byte >> 4], k_digits[byte & 15u]}; }

Error bad(std::string_view why, std::string_view line) {
  std::string shown(line.substr(0, 40));
  std::replace_if(
      shown.begin(), shown.end(), [](char c) { return c < 32 || c > 126; }, '.');
  return make_error(Errc::bad_frame, std::string(why) + ": \"" + shown + "\"");
}

/// Up to the next comma; the comma goes too. Absent where no comma follows.
std::optional<std::string_view> field(std::string_view& rest) {
  const std::size_t comma = rest.find(',');
  if (comma == std::string_view::npos) return std::nullopt;
  const std::string_view out = rest.substr(0, comma);
  rest.remove_prefix(comma + 1);
  return out;
}

template <class T>
std::optional<T> number(std::string_view text, int base) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::string hex(ByteView data) {
  std::string out;
  out.reserve(2 * data.size());
  for (const std::uint8_t byte : data) {
    out += k_digits[byte >> 4];
    out += k_digits[byte & 15u];
  }
  return out;
}

Result<Bytes> unhex(std::string_view text) {
  if (text.size() % 2 != 0) return bad("odd number of hex digits", text);
  Bytes out(text.size() / 2);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const int high = nibble(text[2 * i]), low = nibble(text[2 * i + 1]);
    if (high < 0 || low < 0) return bad("not hex", text);
    out[i] = static_cast<std::uint8_t>(high << 4 | low);
  }
  return out;
}

std::string read_line(std::uint8_t address, std::size_t n) {
  return "R," + hex_byte(address) + "," + std::to_string(n) + "\r";
}

std::string write_line(std::uint8_t address, ByteView data) {
  return "W," + hex_byte(address) + "," + hex(data) + "\r";
}

std::string function_line(std::uint8_t address, ByteView parameters, std::size_t reply_bytes) {
  return "F," + hex_byte(address) + "," + hex(parameters) + "," + std::to_string(reply_bytes) + "\r";
}

std::string reply_line(ByteView data) {
  // Capitals, as tags say it; hosts say small letters, and both sides take either.
  std::string digits = hex(data);
  for (char& c : digits) c = c >= 'a' ? static_cast<char>(c - 'a' + 'A') : c;
  return "D," + digits + "\r\n";
}

Result<Bytes> parse_reply(std::string_view line, std::size_t expected_bytes) {
  if (!line.starts_with("D,")) return bad("not a data line", line);
  line.remove_prefix(2);
  if (line.size() != 2 * expected_bytes) {
    return bad(std::to_string(line.size()) + " digits, not " + std::to_string(2 * expected_bytes), line);
  }
  return unhex(line);
}

std::vector<Chunk> chunks(std::uint8_t address, std::size_t size) {
  std::vector<Chunk> out;
  for (std::size_t at = 0; at < size; at += k_chunk) {
    out.push_back({static_cast<std::uint8_t>(address + at), at, std::min(k_chunk, size - at)});
  }
  return out;
}

Result<Command> parse_command(std::string_view line) {
  std::string_view rest = line;
  const auto word = field(rest);
  if (!word || word->size() != 1) return bad("not a command", line);
  Command command;
  switch (word->front()) {
    case 'R':
    case 'r':
      command.kind = Command::Kind::read;
      break;
    case 'W':
    case 'w':
      command.kind = Command::Kind::write;
      break;
    case 'F':
    case 'f':
      command.kind = Command::Kind::function;
      break;
    default:
      return bad("not a command", line);
  }
  const auto address = field(rest);
  const auto parsed = address && address->size() <= 2 ? number<std::uint8_t>(*address, 16) : std::nullopt;
  if (!parsed) return bad("bad address", line);
  command.address = *parsed;
  if (command.kind != Command::Kind::read) {
    const auto data = command.kind == Command::Kind::write ? std::optional(rest) : field(rest);
    if (!data) return bad("no count", line);
    BOOST_OUTCOME_TRY(command.data, unhex(*data));
    if (command.kind == Command::Kind::write) return command;
  }
  const auto count = number<std::uint8_t>(rest, 10);
  if (!count) return bad("bad count", line);
  command.count = *count;
  return command;
}

void Lines::feed(std::string_view bytes) {
  while (!bytes.empty()) {
    if (end_ == End::carriage_return && partial_.empty() && !skipping_ && bytes.front() == '\n') {
      bytes.remove_prefix(1);
      continue;
    }
    const std::size_t end = bytes.find_first_of(end_ == End::either ? "\r\n" : "\r");
    const std::string_view piece = bytes.substr(0, end);
    if (skipping_) {
      dropped_ += piece.size();
    } else if (partial_.size() + piece.size() > k_max_line) {
      dropped_ += partial_.size() + piece.size();
      partial_.clear();
      skipping_ = true;
    } else {
      partial_ += piece;
    }
    if (end == std::string_view::npos) return;
    if (!partial_.empty()) lines_.push_back(std::exchange(partial_, {}));
    skipping_ = false;
    bytes.remove_prefix(end + 1);
  }
}

std::optional<std::string> Lines::next() {
  if (at_ == lines_.size()) {
    lines_.clear();
    at_ = 0;
    return std::nullopt;
  }
  return std::move(lines_[at_++]);
}

void Lines::clear() {
  lines_.clear();
  partial_.clear();
  at_ = 0;
  skipping_ = false;
}

std::uint16_t u16_at(ByteView data, std::size_t at) {
  return static_cast<std::uint16_t>(data[at] | data[at + 1] << 8);
}
std::int16_t i16_at(ByteView data, std::size_t at) { return static_cast<std::int16_t>(u16_at(data, at)); }
std::uint32_t u32_at(ByteView data, std::size_t at) {
  return static_cast<std::uint32_t>(u16_at(data, at)) | static_cast<std::uint32_t>(u16_at(data, at + 2))
                                                            << 16;
}
std::int32_t i32_at(ByteView data, std::size_t at) { return static_cast<std::int32_t>(u32_at(data, at)); }

void put_u16(Bytes& out, std::uint16_t value) {
  out.push_back(static_cast<std::uint8_t>(value & 0xff));
  out.push_back(static_cast<std::uint8_t>(value >> 8));
}
void put_u32(Bytes& out, std::uint32_t value) {
  put_u16(out, static_cast<std::uint16_t>(value & 0xffff));
  put_u16(out, static_cast<std::uint16_t>(value >> 16));
}

std::string_view error_text(std::uint8_t code) {
  struct Row {
    std::uint8_t code;
    std::string_view text;
  };
  static constexpr std::array k_rows{Row{0x00, "none"},
                                     Row{0x01, "I2C write"},
                                     Row{0x02, "I2C command overflow"},
                                     Row{0x03, "device list full"},
                                     Row{0x04, "communication queue full"},
                                     Row{0x05, "I2C read"},
                                     Row{0x06, "UWB settings rejected"},
                                     Row{0x07, "operation queue full"},
                                     Row{0x08, "bus fault"},
                                     Row{0x09, "flash invalid"},
                                     Row{0x0a, "not enough anchors"},
                                     Row{0x0b, "discovery"},
                                     Row{0x0c, "calibration"},
                                     Row{0x0d, "bad function parameters"},
                                     Row{0x0e, "anchor not found"},
                                     Row{0x0f, "flash"},
                                     Row{0x10, "memory"},
                                     Row{0x11, "ranging failed"},
                                     Row{0x12, "no answer to ranging (first frame)"},
                                     Row{0x13, "no answer to ranging (second frame)"},
                                     Row{0x14, "sent too late"},
                                     Row{0x15, "UWB busy"},
                                     Row{0x16, "positioning"},
                                     Row{0x17, "not acknowledged"},
                                     Row{0xa0, "TDMA"},
                                     Row{0xe0, "sniff overflow"},
                                     Row{0xf0, "no PPS"},
                                     Row{0xf1, "new task"},
                                     Row{0xfe, "hardware not recognised"},
                                     Row{0xff, "general"}};
  const auto* row =
      std::find_if(k_rows.begin(), k_rows.end(), [code](const Row& r) { return r.code == code; });
  return row == k_rows.end() ? "unknown" : row->text;
}

}  // namespace anchord::pozyx
