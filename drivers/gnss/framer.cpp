#include "drivers/gnss/framer.hpp"

#include <algorithm>

#include "core/base/crc24q.hpp"

namespace anchord::gnss {
namespace {

unsigned char byte(std::string_view s, std::size_t i) { return static_cast<unsigned char>(s[i]); }

std::size_t u16_le(std::string_view s, std::size_t i) {
  return byte(s, i) | static_cast<std::size_t>(byte(s, i + 1)) << 8;
}

/// The 8-bit Fletcher pair of UBX and ERB.
bool fletcher_ok(std::string_view covered, unsigned char ck_a, unsigned char ck_b) {
  unsigned a = 0, b = 0;
  for (std::size_t i = 0; i < covered.size(); ++i) {
    a = (a + byte(covered, i)) & 0xffU;
    b = (b + a) & 0xffU;
  }
  return a == ck_a && b == ck_b;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

bool printable(char c) { return c >= 0x20 && c < 0x7f; }
bool digit(char c) { return c >= '0' && c <= '9'; }

enum class Start : std::uint8_t { no, maybe, yes };
/// Whether the stream goes on with these bytes; maybe: so far, and more must come to know.
Start starts_with(std::string_view rest, std::string_view with) {
  if (rest.substr(0, with.size()) == with) return Start::yes;
  return rest.size() < with.size() && with.substr(0, rest.size()) == rest ? Start::maybe : Start::no;
}

// Windows editors put it before a text. It is part of no line, and no noise.
constexpr std::string_view k_byte_order_mark = "\xef\xbb\xbf";

}  // namespace

void Framer::feed(std::string_view bytes, const Sink& sink) {
  constexpr std::size_t k_chunk = 4096;  // keeps the buffer small however much comes at once
  while (!bytes.empty()) {
    const auto part = bytes.substr(0, k_chunk);
    buffer_.append(part);
    bytes.remove_prefix(part.size());
    drain(sink, false);
  }
}

void Framer::finish(const Sink& sink) { drain(sink, true); }

void Framer::drain(const Sink& sink, bool final) {
  std::size_t at = 0;
  while (at < buffer_.size()) {
    const std::string_view rest = std::string_view(buffer_).substr(at);
    Step s = step(rest, final);
    if (s.kind == Step::Kind::need_more) break;
    if (s.kind == Step::Kind::frame) {
      s.frame.offset = offset_ + at;
      sink(s.frame);
      line_start_ = true;
    } else {
      if (s.reason != nullptr) skips_.count(s.reason, offset_ + at, rest.substr(0, 80));
      // Blanks before a line are part of neither it nor anything else. Longer than a byte are only whole
      // things: a comment, a correction, a mark.
      const char last = rest[s.length - 1];
      const bool blank = last == ' ' || last == '\t';
      line_start_ = s.length > 1 || last == '\n' || last == '\r' || (line_start_ && blank);
    }
    at += s.length;
  }
  buffer_.erase(0, at);
  offset_ += at;
}

Framer::Step Framer::step(std::string_view rest, bool final) const {
  const char c = rest[0];
  if (looks_for(Protocol::ubx) && byte(rest, 0) == 0xb5) return ubx(rest, final);
  if (looks_for(Protocol::erb) && c == 'E') {
    const Step s = erb(rest, final);
    if (s.kind != Step::Kind::skip || s.reason != nullptr) return s;
  }
  if (looks_for(Protocol::nmea) && c == '$') return nmea(rest, final);
  if (!only_ && byte(rest, 0) == 0xd3) {
    const Step s = rtcm3(rest, final);
    if (s.kind != Step::Kind::skip || s.reason != nullptr) return s;
  }
  return text(rest, final);
}

Framer::Step Framer::text(std::string_view rest, bool final) const {
  const char c = rest[0];
  if (looks_for(Protocol::gpsd) && c == '{') {
    // Behind a logger's own time (gpspipe -t) it must look like a report, since a brace is nothing rare.
    const Start report = line_start_ ? Start::yes : starts_with(rest, R"({"class":")");
    if (report == Start::yes) return line(rest, final, Protocol::gpsd, k_max_gpsd);
    if (report == Start::maybe && !final) return {};
  }
  if (line_start_) {
    const Start mark = starts_with(rest, k_byte_order_mark);
    if (mark == Start::yes) return {Step::Kind::skip, k_byte_order_mark.size(), {}, nullptr};
    if (mark == Start::maybe && !final) return {};
    if (looks_for(Protocol::llh) && (digit(c) || c == '%'))
      return line(rest, final, Protocol::llh, k_max_llh);
    if (looks_for(Protocol::llh) && c == '#') {
      // Only of text, and never longer than a line may be: noise that looks so must not cost the frames
      // after.
      std::size_t i = 1;
      while (i < rest.size() && i < k_max_llh && (printable(rest[i]) || rest[i] == '\t' || rest[i] == '\r'))
        ++i;
      if (i == rest.size() && i < k_max_llh) {
        if (!final) return {};
      } else if (i < rest.size() && rest[i] == '\n') {
        return {Step::Kind::skip, i + 1, {}, "comment line"};
      }
    }
  }
  const bool blank = c == '\n' || c == '\r' || c == ' ' || c == '\t';
  return {Step::Kind::skip, 1, {}, blank ? nullptr : "byte outside any frame"};
}

Framer::Step Framer::ubx(std::string_view rest, bool final) const {
  const auto wait = [&]() -> Step {
    return final ? Step{Step::Kind::skip, 1, {}, "ubx: cut off at the end"} : Step{};
  };
  if (rest.size() < 2) return wait();
  if (byte(rest, 1) != 0x62) return {Step::Kind::skip, 1, {}, "byte outside any frame"};
  if (rest.size() < 6) return wait();
  const std::size_t payload = u16_le(rest, 4), whole = payload + 8;
  if (payload > k_max_ubx_payload) return {Step::Kind::skip, 1, {}, "ubx: length not believable"};
  if (rest.size() < whole) return wait();
  if (!fletcher_ok(rest.substr(2, payload + 4), byte(rest, whole - 2), byte(rest, whole - 1))) {
    return {Step::Kind::skip, 1, {}, "ubx: checksum wrong"};
  }
  return {Step::Kind::frame, whole, {Protocol::ubx, rest.substr(0, whole), 0}, nullptr};
}

Framer::Step Framer::erb(std::string_view rest, bool final) const {
  const Step not_erb{Step::Kind::skip, 1, {}, nullptr};  // plain text may hold "ER"
  const auto wait = [&]() -> Step {
    return final ? Step{Step::Kind::skip, 1, {}, "erb: cut off at the end"} : Step{};
  };
  if (rest.size() < 2) return final ? not_erb : Step{};
  if (rest[1] != 'R') return not_erb;
  if (rest.size() < 3) return final ? not_erb : Step{};
  if (byte(rest, 2) < 1 || byte(rest, 2) > 7) return not_erb;
  if (rest.size() < 5) return wait();
  const std::size_t payload = u16_le(rest, 3), whole = payload + 7;
  if (payload > k_max_erb_payload) return {Step::Kind::skip, 1, {}, "erb: length not believable"};
  if (rest.size() < whole) return wait();
  if (!fletcher_ok(rest.substr(2, payload + 3), byte(rest, whole - 2), byte(rest, whole - 1))) {
    return {Step::Kind::skip, 1, {}, "erb: checksum wrong"};
  }
  return {Step::Kind::frame, whole, {Protocol::erb, rest.substr(0, whole), 0}, nullptr};
}

/// Preamble d3, six bits 0, ten bits of length, message, CRC-24Q (RTCM 10403.3 section 4).
Framer::Step Framer::rtcm3(std::string_view rest, bool final) const {
  const Step not_rtcm{Step::Kind::skip, 1, {}, nullptr};
  const Step wait = final ? not_rtcm : Step{};
  if (rest.size() < 3) return wait;
  if ((byte(rest, 1) & 0xfcU) != 0) return not_rtcm;
  const std::size_t whole = 6 + (byte(rest, 2) | static_cast<std::size_t>(byte(rest, 1)) << 8);
  if (rest.size() < whole) return wait;
  if (crc24q(rest.substr(0, whole)) != 0) return not_rtcm;  // over its own CRC the remainder is 0
  return {Step::Kind::skip, whole, {}, "rtcm3: corrections, no position"};
}

Framer::Step Framer::nmea(std::string_view rest, bool final) const {
  unsigned sum = 0;
  std::size_t i = 1;
  for (; i < rest.size() && rest[i] != '*'; ++i) {
    if (rest[i] == '\r' || rest[i] == '\n') return {Step::Kind::skip, 1, {}, "nmea: no checksum"};
    if (rest[i] == '$') return {Step::Kind::skip, 1, {}, "nmea: another sentence starts inside"};
    if (!printable(rest[i])) return {Step::Kind::skip, 1, {}, "nmea: byte that is no text"};
    if (i >= k_max_nmea) return {Step::Kind::skip, 1, {}, "nmea: longer than 1024 bytes"};
    sum ^= byte(rest, i);
  }
  if (rest.size() < i + 3) return final ? Step{Step::Kind::skip, 1, {}, "nmea: cut off at the end"} : Step{};
  const int high = hex_digit(rest[i + 1]), low = hex_digit(rest[i + 2]);
  if (high < 0 || low < 0) return {Step::Kind::skip, 1, {}, "nmea: no checksum"};
  if (static_cast<unsigned>(high * 16 + low) != sum) return {Step::Kind::skip, 1, {}, "nmea: checksum wrong"};
  return {Step::Kind::frame, i + 3, {Protocol::nmea, rest.substr(1, i - 1), 0}, nullptr};
}

Framer::Step Framer::line(std::string_view rest, bool final, Protocol protocol, std::size_t limit) const {
  const bool gpsd = protocol == Protocol::gpsd;
  const char* too_long = gpsd ? "gpsd: line too long" : "llh: line too long";
  std::size_t i = 0;
  for (; i < rest.size() && rest[i] != '\n'; ++i) {
    if (i >= limit) return {Step::Kind::skip, 1, {}, too_long};
    const bool text =
        printable(rest[i]) || rest[i] == '\t' || rest[i] == '\r' || (gpsd && byte(rest, i) >= 0x80);
    // A logger's own time (or noise) in front of a sentence: the line is the sentence's, not ours.
    if (!text || (!gpsd && (rest[i] == '$' || rest[i] == '{'))) {
      return {Step::Kind::skip, 1, {}, "byte outside any frame"};
    }
  }
  if (i == rest.size()) {
    if (!final) return {};
    if (!gpsd) return {Step::Kind::skip, 1, {}, "llh: cut off at the end"};
  }
  std::string_view bytes = rest.substr(0, i);
  while (!bytes.empty() && (bytes.back() == '\r' || bytes.back() == ' ')) bytes.remove_suffix(1);
  return {Step::Kind::frame, std::min(i + 1, rest.size()), {protocol, bytes, 0}, nullptr};
}

}  // namespace anchord::gnss
