#include "drivers/ntrip/client.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <utility>

#include "core/base/base64.hpp"
#include "core/base/text.hpp"

namespace anchord::ntrip {
namespace {

constexpr std::int64_t k_second_ns = 1'000'000'000;
constexpr std::int64_t k_answer_ns = 10 * k_second_ns, k_position_ns = 10 * k_second_ns,
                       k_silent_ns = 20 * k_second_ns;
constexpr std::size_t k_most_head = 16'384;
constexpr std::size_t k_most_chunk = 1 << 20;
/// Without one good frame in so many bytes the stream is no RTCM 3: a minute of the busiest mounts.
constexpr std::size_t k_most_noise = 64 << 10;
/// Of good frames: three times what all satellites at 5 Hz need. A caster that sends more would fill the link
/// of the receiver, and its positions would be lost with it.
constexpr double k_rate_bytes_per_s = 32 << 10, k_burst_bytes = 64 << 10;
constexpr std::uint64_t k_worth_telling = 2048;  ///< more than the half frame a stream may begin with

constexpr const char* k_web_page =
    "the caster sends a web page (HTML): check address, port and mount, or sign in to this network's login "
    "page";

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

/// The first line of a file: the password. Nothing: it cannot be read.
std::optional<std::string> first_line(const std::string& file) {
  std::ifstream in(file);
  std::string line;
  if (!std::getline(in, line)) return std::nullopt;
  if (line.ends_with('\r')) line.pop_back();
  return line;
}

/// One line from the front, without its end; nothing while it is not whole.
std::optional<std::string> take_line(std::string& held) {
  const auto end = held.find('\n');
  if (end == std::string::npos) return std::nullopt;
  std::string line = held.substr(0, end);
  held.erase(0, end + 1);
  if (line.ends_with('\r')) line.pop_back();
  return line;
}

}  // namespace

std::string gga_of(const device::RoverStatus& rover) {
  if (!rover.position || rover.fix == FixClass::none) return {};
  const auto angle = [](double degrees, int width) {
    const auto units = static_cast<long long>(std::llround(std::abs(degrees) * 60 * 1e4));
    std::array<char, 32> out{};
    std::snprintf(out.data(), out.size(), "%0*lld%02lld.%04lld", width, units / 600'000,
                  units % 600'000 / 10'000, units % 10'000);
    return std::string(out.data());
  };
  const auto& p = *rover.position;
  const std::int64_t tod = rover.time.ns / k_second_ns % 86'400;
  const int quality = rover.fix == FixClass::rtk_fixed   ? 4
                      : rover.fix == FixClass::rtk_float ? 5
                      : rover.fix == FixClass::dgps      ? 2
                                                         : 1;
  const double msl_m = rover.height_msl_m.value_or(p.height_m);
  std::array<char, 160> body{};
  std::snprintf(body.data(), body.size(), "GPGGA,%02d%02d%02d.00,%s,%c,%s,%c,%d,%02d,%.1f,%.3f,M,%.3f,M,,",
                static_cast<int>(tod / 3600), static_cast<int>(tod / 60 % 60), static_cast<int>(tod % 60),
                angle(p.lat_deg, 2).c_str(), p.lat_deg < 0 ? 'S' : 'N', angle(p.lon_deg, 3).c_str(),
                p.lon_deg < 0 ? 'W' : 'E', quality, std::min(rover.satellites.value_or(12), 99),
                rover.hdop.value_or(1.0), msl_m, p.height_m - msl_m);
  unsigned sum = 0;
  for (const char* c = body.data(); *c != 0; ++c) sum ^= static_cast<unsigned char>(*c);
  std::array<char, 8> end{};
  std::snprintf(end.data(), end.size(), "*%02X\r\n", sum);
  return "$" + std::string(body.data()) + end.data();
}

Client::Client(ClientOptions options, device::DriverOutput& output)
    : options_(std::move(options)), out_(output) {}

void Client::opened(const device::Arrival& now) {
  state_ = State::status;
  held_.clear();
  mounts_.clear();
  chunked_ = is_table_ = false;
  chunk_left_ = 0;
  frames_ = {};
  silent_ = false;
  skipped_ = handed_on_ = 0;
  since_frame_ = 0;
  noise_.clear();
  budget_ = k_burst_bytes;
  budget_at_ns_ = now.steady_ns;
  too_many_ = false;
  deadline_ns_ = now.steady_ns + k_answer_ns;
  std::string request =
      "GET /" + options_.mount + (options_.version == 1 ? " HTTP/1.0\r\n" : " HTTP/1.1\r\n");
  if (options_.version != 1) request += "Host: " + options_.host + "\r\nNtrip-Version: Ntrip/2.0\r\n";
  request += "User-Agent: NTRIP anchord/1\r\n";
  if (!options_.user.empty() || !options_.password_file.empty()) {
    const auto password = options_.password_file.empty() ? std::string() : first_line(options_.password_file);
    if (!password) return refuse("password_file: cannot read " + options_.password_file, 30);
    request += "Authorization: Basic " + base64(options_.user + ":" + *password) + "\r\n";
  }
  if (options_.version != 1) request += "Connection: close\r\n";
  out_.send(request + "\r\n");
}

void Client::closed(const device::Arrival&) {
  if (state_ == State::table) table_end();
  state_ = State::closed;
  deadline_ns_.reset();
}

void Client::refuse(const std::string& why, std::int64_t wait_s) {
  state_ = State::refused;
  deadline_ns_.reset();
  held_.clear();
  out_.dropped("caster_refused");
  out_.hang_up(why, wait_s * k_second_ns);
}

void Client::bytes(std::string_view bytes, const device::Arrival& at) {
  if (state_ == State::closed || state_ == State::refused) return;
  if (state_ == State::stream) return stream(bytes, at);
  held_ += bytes;
  if (held_.size() > k_most_head && state_ != State::table)
    return refuse("the caster's answer is not NTRIP", 30);
  head(at);
}

void Client::head(const device::Arrival& at) {
  while (state_ == State::status || state_ == State::headers || state_ == State::table ||
         state_ == State::maybe_headers) {
    if (state_ == State::maybe_headers) {
      // Version 1 may say nothing, an empty line, or header lines before the stream, which begins with D3.
      if (held_.empty()) return;
      const auto first = static_cast<unsigned char>(held_.front());
      if (first >= 0x80) return begin_stream(at);
    }
    const auto line = take_line(held_);
    if (!line) {
      if (state_ == State::table && held_.size() > k_most_head) held_.clear();
      return;
    }
    if (state_ == State::status) {
      if (!status_line(*line)) return;
    } else if (state_ == State::table) {
      table_line(*line);
    } else if (line->empty()) {
      if (!is_table_) return begin_stream(at);
      state_ = State::table;
    } else {
      header_line(*line);
    }
  }
}

bool Client::status_line(const std::string& line) {
  if (line.starts_with("ICY 200")) {
    state_ = State::maybe_headers;
    return true;
  }
  if (line.starts_with("SOURCETABLE 200")) {
    is_table_ = true;
    state_ = State::headers;
    return true;
  }
  const int code = line.starts_with("HTTP/1.") && line.size() >= 12 ? std::atoi(line.c_str() + 9) : 0;
  if (code == 200) {
    state_ = State::headers;
    return true;
  }
  if (code == 401) {
    refuse("the caster rejects the user or the password", 60);
  } else if (code == 404) {
    refuse("the caster has no mount \"" + options_.mount + "\"", 60);
  } else if (code == 409) {
    refuse("mount \"" + options_.mount + "\" is busy", 30);
  } else {
    refuse("the caster answers \"" + to_utf8(line, 80) + "\"", 30);
  }
  return false;
}

void Client::header_line(const std::string& line) {
  const std::string text = lower(line);
  if (text.starts_with("transfer-encoding:") && text.find("chunked") != std::string::npos) chunked_ = true;
  if (text.starts_with("content-encoding:") && text.find("gzip") != std::string::npos)
    refuse("the caster compresses its stream, which is not supported", 60);
  // A login page, or a proxy's error: its text must not reach a receiver.
  const bool page = text.starts_with("content-type:") && text.find("text/html") != std::string::npos;
  if (page || text.starts_with('<')) return refuse(k_web_page, 30);
  if (text.starts_with("content-type:") && text.find("sourcetable") != std::string::npos) is_table_ = true;
}

void Client::table_line(const std::string& line) {
  if (line.starts_with("STR;") && mounts_.size() < 200) {
    mounts_ += (mounts_.empty() ? "" : ", ") + to_utf8(line.substr(4, line.find(';', 4) - 4), 40);
  }
  if (line.starts_with("ENDSOURCETABLE")) table_end();
}

void Client::table_end() {
  refuse("the caster has no mount \"" + options_.mount + "\"; it has " + (mounts_.empty() ? "none" : mounts_),
         60);
}

void Client::begin_stream(const device::Arrival& at) {
  state_ = State::stream;
  device::Identity identity;
  identity.model = "NTRIP caster";
  identity.serial = options_.mount;
  out_.identified(identity);
  stream_since_ns_ = at.steady_ns;
  stream_tick(at);
  std::string rest;
  rest.swap(held_);
  if (!rest.empty()) stream(rest, at);
}

void Client::stream(std::string_view bytes, const device::Arrival& at) {
  if (chunked_) return unchunk(bytes, at);
  const auto before = frames_.base();
  const int good = frames_.feed(bytes);
  hand_on(at);
  if (good > 0) {
    if (std::exchange(silent_, false)) out_.notice("");
    stream_since_ns_ = at.steady_ns;
    out_.heard();
  }
  if (frames_.base() && frames_.base() != before) out_.base(*frames_.base());
  judge_noise(bytes, good);
}

void Client::hand_on(const device::Arrival& at) {
  const double passed_s = static_cast<double>(at.steady_ns - budget_at_ns_) * 1e-9;
  budget_ = std::min(k_burst_bytes, budget_ + passed_s * k_rate_bytes_per_s);
  budget_at_ns_ = at.steady_ns;
  for (const auto& frame : frames_.whole()) {
    if (static_cast<double>(frame.size()) > budget_) {
      too_many_ = true;
      out_.dropped("too_many_corrections");
      continue;
    }
    budget_ -= static_cast<double>(frame.size());
    handed_on_ += frame.size();
    out_.corrections(frame);
  }
}

void Client::judge_noise(std::string_view bytes, int good) {
  if (frames_.skipped() > skipped_) out_.dropped("no_rtcm_bytes", frames_.skipped() - skipped_);
  skipped_ = frames_.skipped();
  since_frame_ = good > 0 ? 0 : since_frame_ + bytes.size();
  if (good > 0) noise_.clear();
  if (noise_.size() < 64) noise_ += bytes.substr(0, 64 - noise_.size());
  if (since_frame_ > k_most_noise) {
    const bool page =
        noise_.find_first_not_of(" \t\r\n") == noise_.find('<') && noise_.find('<') != noise_.npos;
    return refuse(
        page ? k_web_page
             : "the caster sends bytes that are no RTCM 3, which do not go to receivers: choose a mount "
               "of RTCM 3",
        30);
  }
  if (too_many_)
    out_.notice(
        "the caster sends more corrections than a receiver's link carries (32 KiB/s): the rest is dropped");
  else if (skipped_ > k_worth_telling && skipped_ * 10 > handed_on_)
    out_.notice("a part of what the caster sends is no RTCM 3 and does not go to receivers (no_rtcm_bytes)");
}

void Client::unchunk(std::string_view bytes, const device::Arrival& at) {
  chunked_ = false;  // what is inside goes through stream()
  while (!bytes.empty() && state_ == State::stream) {
    if (chunk_left_ > 0) {
      const auto part = bytes.substr(0, chunk_left_);
      chunk_left_ -= part.size();
      bytes.remove_prefix(part.size());
      stream(part, at);
      continue;
    }
    const char c = bytes.front();
    bytes.remove_prefix(1);
    if (c != '\n') {
      if (c != '\r') held_ += c;
      if (held_.size() > 64) refuse("the caster's stream is damaged (chunked encoding)", 30);
      continue;
    }
    if (held_.empty()) continue;  // the end of the chunk before
    char* end = nullptr;
    const auto size = std::strtoull(held_.c_str(), &end, 16);
    const bool good = end != held_.c_str() && size <= k_most_chunk;
    held_.clear();
    if (!good) refuse("the caster's stream is damaged (chunked encoding)", 30);
    if (good && size == 0) refuse("the caster ended the stream", 5);
    chunk_left_ = good ? static_cast<std::size_t>(size) : 0;
  }
  chunked_ = true;
}

void Client::stream_tick(const device::Arrival& now) {
  deadline_ns_ = now.steady_ns + k_position_ns;
  const auto rover = options_.send_gga ? out_.rover_position() : std::nullopt;
  const auto sentence = rover ? gga_of(*rover) : std::string();
  if (!sentence.empty()) out_.send(sentence);
  if (silent_ || now.steady_ns - stream_since_ns_ < k_silent_ns) return;
  silent_ = true;
  out_.notice(
      "mount \"" + options_.mount + "\" is open and sends no corrections" +
      (options_.send_gga && sentence.empty()
           ? ": a mount of a network waits for the position of a rover, and there is none with a fix"
           : ": its base may be switched off; look at it in the caster's table, or choose another mount"));
}

void Client::tick(const device::Arrival& now) {
  if (!deadline_ns_ || now.steady_ns < *deadline_ns_) return;
  if (state_ == State::stream) return stream_tick(now);
  if (state_ == State::table) return table_end();
  if (state_ == State::maybe_headers) return begin_stream(now);
  refuse("no answer from the caster within 10 s", 10);
}

void Client::command(const device::Command& command, const device::Arrival&) {
  out_.answer(command.id, make_error(Errc::unsupported, "an NTRIP caster does not support the command \"" +
                                                            command.name + "\""));
}

}  // namespace anchord::ntrip
