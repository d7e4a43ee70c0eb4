#include <CLI/CLI.hpp>
#include <array>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <utility>

#include "core/base/time.hpp"
#include "drivers/gnss/decoder.hpp"
#include "server/cli/commands.hpp"

namespace anchord::cli {
namespace {

constexpr std::array<std::string_view, 5> k_fix_words{"none", "single", "dgps", "float", "fixed"};

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
  put("fix", std::string(k_fix_words[static_cast<std::size_t>(epoch.fix)]), true);
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

void report(const gnss::Decoder& decoder, std::size_t epochs, std::size_t dateless) {
  std::fprintf(stderr, "%zu epochs from", epochs);
  for (const auto p : {gnss::Protocol::nmea, gnss::Protocol::ubx, gnss::Protocol::erb, gnss::Protocol::llh,
                       gnss::Protocol::gpsd}) {
    if (decoder.frames(p) > 0) {
      std::fprintf(stderr, " %llu %s", static_cast<unsigned long long>(decoder.frames(p)),
                   std::string(gnss::to_string(p)).c_str());
    }
  }
  std::fputs(" frames\n", stderr);
  if (dateless > 0) {
    std::fprintf(stderr, "%zu epochs without a date: no RMC or ZDA in the stream; give one with --date\n",
                 dateless);
  }
  for (const auto& [reason, entry] : decoder.skips().entries()) {
    std::fprintf(stderr, "skipped: %s: %llu, first at byte %llu: %s\n", reason.c_str(),
                 static_cast<unsigned long long>(entry.count),
                 static_cast<unsigned long long>(entry.first_offset), entry.example.c_str());
  }
}

struct Decode {
  std::string file, format{"auto"}, gst{"larger"}, date;
  bool csv{false}, json{false};
};

int run(const Decode& options) {
  gnss::DecoderOptions decoder_options;
  for (const auto p : {gnss::Protocol::nmea, gnss::Protocol::ubx, gnss::Protocol::erb, gnss::Protocol::llh,
                       gnss::Protocol::gpsd}) {
    if (options.format == gnss::to_string(p)) decoder_options.only = p;
  }
  if (options.gst == "standard") decoder_options.gst_order = gnss::nmea::GstOrder::standard;
  if (!options.date.empty()) {
    const auto noon = parse_rfc3339(options.date + "T12:00:00Z");
    if (!noon) {
      std::fprintf(stderr, "anchord decode: --date %s: %s\n", options.date.c_str(),
                   noon.error().message.c_str());
      return 2;
    }
    decoder_options.reference = noon.value();
  }
  std::ifstream file;
  if (options.file != "-") {
    file.open(options.file, std::ios::binary);
    if (!file) {
      std::fprintf(stderr, "anchord decode: cannot read %s\n", options.file.c_str());
      return 2;
    }
  }
  std::istream& in = options.file == "-" ? std::cin : file;

  gnss::Decoder decoder(decoder_options);
  gnss::Epochs epochs;
  std::size_t count = 0, dateless = 0;
  const auto flush = [&] {
    for (const auto& epoch : epochs) {
      const auto line = line_of(epoch, options.json);
      std::fwrite(line.data(), 1, line.size(), stdout);
      if (!epoch.time && epoch.time_of_day_ns) ++dateless;
      ++count;
    }
    epochs.clear();
  };
  if (!options.json) std::fputs(header().c_str(), stdout);
  std::array<char, 65536> buffer{};
  while (in.read(buffer.data(), buffer.size()), in.gcount() > 0) {
    decoder.feed({buffer.data(), static_cast<std::size_t>(in.gcount())}, epochs);
    flush();
  }
  decoder.finish(epochs);
  flush();
  report(decoder, count, dateless);
  return count > 0 ? 0 : 1;
}

}  // namespace

void add_decode_command(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Decode>();
  auto* command =
      app.add_subcommand("decode", "Print every epoch of a GNSS log; what was skipped goes to stderr");
  command->add_option("FILE", options->file, "log, - for standard input")->required();
  command->add_option("--format", options->format, "auto takes every format the stream holds")
      ->check(CLI::IsMember({"auto", "nmea", "ubx", "erb", "llh", "gpsd"}));
  command
      ->add_option(
          "--gst", options->gst,
          "NMEA GST sigmas: the larger of latitude and longitude for both (some receivers swap them), or "
          "the standard order")
      ->check(CLI::IsMember({"larger", "standard"}));
  command->add_option("--date", options->date, "YYYY-MM-DD of an NMEA log that has no RMC or ZDA");
  auto* csv = command->add_flag("--csv", options->csv, "CSV with a header line (default)");
  command->add_flag("--json", options->json, "one JSON object per line, null for unknown")->excludes(csv);
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace anchord::cli
