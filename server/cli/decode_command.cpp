#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <utility>

#include "core/base/text.hpp"
#include "core/base/time.hpp"
#include "drivers/gnss/decoder.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/words.hpp"

namespace anchord::cli {
namespace {

struct Column {
  const char* name;
  std::optional<double> gnss::Epoch::*value;
  int decimals;
};
constexpr std::array k_position{Column{"lat_deg", &gnss::Epoch::lat_deg, 9},
                                Column{"lon_deg", &gnss::Epoch::lon_deg, 9},
                                Column{"height_ellipsoid_m", &gnss::Epoch::height_ellipsoid_m, 4},
                                Column{"height_msl_m", &gnss::Epoch::height_msl_m, 4}};
constexpr std::array k_quality{
    Column{"age_s", &gnss::Epoch::age_s, 2}, Column{"sigma_e_m", &gnss::Epoch::sigma_e_m, 4},
    Column{"sigma_n_m", &gnss::Epoch::sigma_n_m, 4}, Column{"sigma_u_m", &gnss::Epoch::sigma_u_m, 4},
    Column{"hdop", &gnss::Epoch::hdop, 2}};

std::string fixed(double value, int decimals) {
  std::array<char, 64> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, decimals);
  return {text.data(), end.ptr};
}

/// RFC 3339; "T09:15:00.200000Z" where the stream never told the date; empty without any time.
std::string time_text(const gnss::Epoch& epoch) {
  if (epoch.time) return to_rfc3339(*epoch.time);
  if (!epoch.time_of_day_ns) return {};
  return to_rfc3339(UtcTime{*epoch.time_of_day_ns}).substr(10);
}

/// One epoch as a line; `json` as an object with null for what is unknown, else CSV with nothing there.
std::string line_of(const gnss::Epoch& epoch, bool json) {
  std::string out = json ? "{" : "";
  bool first = true;
  const auto put = [&](const char* name, const std::string& text, bool quoted) {
    if (!std::exchange(first, false)) out += ',';
    if (json) out += '"' + std::string(name) + "\":";
    if (json && text.empty())
      out += "null";
    else if (json && quoted)
      out += '"' + text + '"';
    else
      out += text;
  };
  const auto numbers = [&](const auto& columns) {
    for (const auto& column : columns) {
      const auto& value = epoch.*(column.value);
      put(column.name, value ? fixed(*value, column.decimals) : "", false);
    }
  };
  put("t_utc", time_text(epoch), true);
  numbers(k_position);
  put("fix", std::string(k_fix_words.word(epoch.fix)), true);
  put("sats", epoch.satellites ? std::to_string(*epoch.satellites) : "", false);
  numbers(k_quality);
  return out + (json ? "}\n" : "\n");
}

std::string header() {
  std::string out = "t_utc";
  for (const auto& c : k_position) out += std::string(",") + c.name;
  out += ",fix,sats";
  for (const auto& c : k_quality) out += std::string(",") + c.name;
  return out + "\n";
}

/// What was found, for the report at the end.
struct Found {
  std::uint64_t bytes{0}, epochs{0}, dateless{0}, timeless{0};
  std::map<FixClass, std::uint64_t> by_fix{};
  std::map<gnss::Protocol, std::uint64_t> by_protocol{};
  bool utf16{false};

  void add(const gnss::Epoch& epoch) {
    ++epochs;
    ++by_fix[epoch.fix];
    ++by_protocol[epoch.protocol];
    if (!epoch.time) ++(epoch.time_of_day_ns ? dateless : timeless);
  }
};

/// "12 fixed, 3 float" of what there is; empty of nothing.
template <class T, std::size_t N>
std::string listed(const std::map<T, std::uint64_t>& counts, const EnumTable<T, N>& table) {
  std::string out;
  for (const auto& [value, n] : counts) {
    if (n > 0) out += (out.empty() ? "" : ", ") + std::to_string(n) + ' ' + std::string(table.word(value));
  }
  return out;
}

/// Why there is nothing, for somebody who expected something.
const char* why_nothing(const Found& found, bool any_frames, bool all_formats) {
  if (found.bytes == 0) return "the input is empty";
  if (found.utf16) return "the input is UTF-16 text: save it as UTF-8";
  if (any_frames)
    return "no position among them: positions are in GGA, GNS or RMC (nmea), NAV-PVT (ubx), POS and STAT "
           "(erb), "
           "solution lines (llh), TPV with a time (gpsd)";
  return all_formats ? "it contains no NMEA, UBX, ERB, LLH or gpsd JSON with a valid checksum or form"
                     : "it contains nothing of this format: --format auto accepts all formats";
}

void report(const gnss::Decoder& decoder, const Found& found, bool all_formats) {
  std::map<gnss::Protocol, std::uint64_t> frames;
  for (const auto& [word, protocol] : gnss::k_protocol_words) frames[protocol] = decoder.frames(protocol);
  const auto from = listed(frames, gnss::k_protocol_words);
  std::fprintf(stderr, "%llu epochs from %s frames of %llu bytes\n",
               static_cast<unsigned long long>(found.epochs), from.empty() ? "no" : from.c_str(),
               static_cast<unsigned long long>(found.bytes));
  if (found.epochs == 0) {
    std::fprintf(stderr, "%s\n", why_nothing(found, !from.empty(), all_formats));
  } else {
    std::fprintf(stderr, "fix: %s\n", listed(found.by_fix, k_fix_words).c_str());
  }
  if (found.by_protocol.size() > 1) {
    std::fprintf(stderr,
                 "epochs in several formats (%s), often the same epochs twice: select one with --format\n",
                 listed(found.by_protocol, gnss::k_protocol_words).c_str());
  }
  if (found.dateless > 0) {
    std::fprintf(stderr,
                 "%llu epochs without a date: no RMC or ZDA in the stream; give the date with --date\n",
                 static_cast<unsigned long long>(found.dateless));
  }
  if (found.timeless > 0) {
    std::fprintf(stderr, "%llu epochs without a time: the receiver had no time yet\n",
                 static_cast<unsigned long long>(found.timeless));
  }
  if (decoder.llh_time_assumed() > 0) {
    std::fprintf(stderr,
                 "llh: %llu lines before any header that names the time system, read with --llh-time "
                 "(default utc); RTKLIB writes gpst, which is 18 s ahead of utc\n",
                 static_cast<unsigned long long>(decoder.llh_time_assumed()));
  }
  for (const auto& [reason, entry] : decoder.skips().entries()) {
    std::fprintf(stderr, "skipped: %s: %llu, first at byte %llu%s%s\n", printable(reason).c_str(),
                 static_cast<unsigned long long>(entry.count),
                 static_cast<unsigned long long>(entry.first_offset), entry.example.empty() ? "" : ": ",
                 entry.example.c_str());
  }
}

struct Decode {
  std::string file, format{"auto"}, date;
  gnss::nmea::GstOrder gst{gnss::nmea::GstOrder::larger_for_both};
  gnss::llh::TimeSystem llh_time{gnss::llh::TimeSystem::utc};
  bool csv{false}, json{false};
};

/// Nothing where the date is none; told to the user.
std::optional<gnss::DecoderOptions> decoder_options(const Decode& options) {
  gnss::DecoderOptions out;
  out.only = gnss::k_protocol_words.find(options.format);
  out.llh_time = options.llh_time;
  out.gst_order = options.gst;
  if (!options.date.empty()) {
    const auto noon = parse_rfc3339(options.date + "T12:00:00Z");
    if (!noon) {
      std::fprintf(stderr, "anchord decode: --date %s: %s\n", options.date.c_str(),
                   printable(noon.error().message).c_str());
      return std::nullopt;
    }
    out.reference = noon.value();
  }
  return out;
}

/// A file or standard input, read as it comes, so that a live stream in a pipe shows each epoch at once.
class Input {
 public:
  explicit Input(const std::string& path)
      : fd_(path == "-" ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (fd_ < 0) error_ = errno;
  }
  ~Input() {
    if (fd_ > STDIN_FILENO) ::close(fd_);
  }
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  /// What is there, at most a buffer of it; empty at the end and after an error.
  std::string_view read() {
    if (error_ != 0) return {};
    ssize_t got = -1;
    do got = ::read(fd_, buffer_.data(), buffer_.size());
    while (got < 0 && errno == EINTR);
    if (got < 0) error_ = errno;
    return {buffer_.data(), got > 0 ? static_cast<std::size_t>(got) : 0};
  }
  /// Of errno; 0 while all is well.
  int error() const { return error_; }

 private:
  int fd_;
  int error_{0};
  std::array<char, 65536> buffer_{};
};

/// 0 with epochs, 1 without any, 2 where the input cannot be read or the output not be written.
int run(const Decode& options) {
  const auto decoder_options_given = decoder_options(options);
  if (!decoder_options_given) return 2;
  Input input(options.file);
  auto bytes = input.read();
  if (input.error() != 0) {
    std::fprintf(stderr, "anchord decode: cannot read %s: %s\n", options.file.c_str(),
                 std::strerror(input.error()));
    return 2;
  }

  gnss::Decoder decoder(*decoder_options_given);
  gnss::Epochs epochs;
  Found found;
  found.utf16 = bytes.substr(0, 2) == "\xff\xfe" || bytes.substr(0, 2) == "\xfe\xff";
  const auto write = [&] {
    for (const auto& epoch : epochs) {
      const auto line = line_of(epoch, options.json);
      std::fwrite(line.data(), 1, line.size(), stdout);
      found.add(epoch);
    }
    if (!epochs.empty()) std::fflush(stdout);
    epochs.clear();
  };
  if (!options.json) std::fputs(header().c_str(), stdout);
  for (; !bytes.empty() && std::ferror(stdout) == 0; bytes = input.read()) {
    found.bytes += bytes.size();
    decoder.feed(bytes, epochs);
    write();
  }
  decoder.finish(epochs);
  write();
  report(decoder, found, !decoder_options_given->only);
  if (input.error() != 0)
    std::fprintf(stderr, "anchord decode: reading of %s failed: %s\n", options.file.c_str(),
                 std::strerror(input.error()));
  if (input.error() != 0 || std::fflush(stdout) != 0 || std::ferror(stdout) != 0) return 2;
  return found.epochs > 0 ? 0 : 1;
}

}  // namespace

void add_decode_command(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Decode>();
  auto* command =
      app.add_subcommand("decode", "Print every epoch of a GNSS log; what was skipped goes to stderr");
  command->add_option("FILE", options->file, "log, - for standard input")->required();
  auto formats = words_of(gnss::k_protocol_words);
  formats.emplace_back("auto");
  command->add_option("--format", options->format, "auto accepts every format in the stream")
      ->check(CLI::IsMember(formats));
  add_word(*command, "--gst", options->gst, gnss::nmea::k_gst_order_words,
           "NMEA GST sigmas: the larger of latitude and longitude for both (some receivers swap them), or "
           "the standard order");
  command->add_option("--date", options->date, "YYYY-MM-DD of an NMEA log that has no RMC or ZDA");
  add_word(*command, "--llh-time", options->llh_time, gnss::llh::k_time_system_words,
           "time system of LLH lines without a header: utc as Reach streams them, gpst as RTKLIB does");
  auto* csv = command->add_flag("--csv", options->csv, "CSV with a header line (default)");
  command->add_flag("--json", options->json, "one JSON object per line, null for unknown")->excludes(csv);
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace anchord::cli
