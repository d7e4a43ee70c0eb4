#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <thread>

#include "api/formats/flight_folder.hpp"
#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "drivers/device/replay.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/flight_upload.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/replay_recording.hpp"

namespace anchord::cli {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr auto k_tick = std::chrono::milliseconds(100);

struct ReplayOptions {
  std::string source, url{"http://127.0.0.1:8420"}, speed{"1"}, token_file, name, out, mission;
  bool loop{false}, url_given{false}, speed_given{false};
};

/// Infinity for "max"; nothing for what is no speed.
std::optional<double> parse_speed(const std::string& text) {
  if (text == "max") return std::numeric_limits<double>::infinity();
  char* end = nullptr;
  const double speed = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || *end != '\0' || !(speed > 0) || !std::isfinite(speed)) return std::nullopt;
  return speed;
}

/// Stamps the flight so that it ends when the playback ends. Differences between times stay what they were,
/// so that speeds and gaps are real, and no row is ever stamped later than it is sent.
void stamp_to_now(FlightUpload& upload, double speed, UtcTime now) {
  const double length_s = seconds_between(upload.first(), upload.last());
  const auto playing_ns = static_cast<std::int64_t>(length_s / speed * 1e9);
  upload.shift(now.ns + playing_ns - upload.last().ns);
}

Result<void> play(FlightUpload& upload, double speed) {
  Progress progress("replay");
  if (std::isinf(speed)) {
    while (!upload.done()) {
      BOOST_OUTCOME_TRY(upload.send_next_batch());
      progress.show(upload.fraction());
    }
    return boost::outcome_v2::success();
  }
  const UtcTime first = upload.first();
  const auto start = SteadyClock::now();
  auto next = start;
  while (!upload.done()) {
    if (interrupted()) return make_error(Errc::canceled, "stopped");
    std::this_thread::sleep_until(next);
    const double elapsed_s = std::chrono::duration<double>(SteadyClock::now() - start).count();
    BOOST_OUTCOME_TRY(
        upload.send_before(UtcTime{first.ns + static_cast<std::int64_t>(elapsed_s * speed * 1e9)}));
    progress.show(upload.fraction());
    next = std::max(next + k_tick, SteadyClock::now());
  }
  return boost::outcome_v2::success();
}

Result<void> play_once(const ReplayOptions& options, RestClient& client, const FlightData& flight,
                       double speed) {
  FlightUpload upload(client, flight);
  stamp_to_now(upload, speed, SystemClock{}.now());
  BOOST_OUTCOME_TRY(upload.create_mission(options.name.empty() ? flight.mission.name : options.name));
  std::fprintf(stderr, "replay: mission %s\n", upload.mission_id().c_str());
  const auto played = play(upload, speed);
  std::fprintf(stderr, "replay: %s\n", upload.summary().c_str());
  if (!played) return played;
  return upload.finish_mission();
}

/// Ranges with their impulse responses, a page at a time: as text they are several times their size.
Result<std::vector<Range>> fetch_ranges(RestClient& client, const std::string& mission) {
  const std::string first = "/api/v1/ranges?cir=true&limit=1000&mission=" + mission;
  std::vector<Range> rows;
  std::string cursor;
  do {
    BOOST_OUTCOME_TRY(const auto body, client.get(cursor.empty() ? first : first + "&cursor=" + cursor));
    BOOST_OUTCOME_TRY(auto page, api::parse_range_page(body));
    std::ranges::move(page.rows, std::back_inserter(rows));
    cursor = page.next_cursor;  // of digits and a dot
  } while (!cursor.empty());
  return rows;
}

/// A flight the server has, as it gives it.
Result<FlightData> fetch_flight(RestClient& client, const std::string& id) {
  FlightData flight;
  BOOST_OUTCOME_TRY(const auto mission, client.get("/api/v1/missions/" + id));
  BOOST_OUTCOME_TRY(flight.mission, api::parse_mission(mission));
  BOOST_OUTCOME_TRY(const auto fixes, client.get("/api/v1/fixes?format=ndjson&mission=" + id));
  BOOST_OUTCOME_TRY(flight.fixes, api::parse_fixes(fixes));
  BOOST_OUTCOME_TRY(flight.ranges, fetch_ranges(client, id));
  return flight;
}

int replay(const ReplayOptions& options) {
  const bool recording = device::is_recording(options.source);
  if (recording && !options.url_given)
    return derive_recording(options.source, options.out.empty() ? "-" : options.out);
  const auto speed = parse_speed(options.speed);
  if (!speed) {
    std::fprintf(stderr, "anchord replay: --speed must be a number above 0, or max: %s\n",
                 options.speed.c_str());
    return 2;
  }
  const auto token = read_token_file(options.token_file);
  if (!token) {
    std::fprintf(stderr, "anchord replay: %s\n", printable(token.error().message).c_str());
    return 2;
  }
  auto client = RestClient::make(options.url, token.value(), interrupted);
  if (!client) {
    std::fprintf(stderr, "anchord replay: %s\n", printable(client.error().message).c_str());
    return 2;
  }
  if (recording) {
    if (options.loop || !options.out.empty()) {
      std::fprintf(
          stderr,
          "anchord replay: with a recording that is sent to a server, --loop and --out are not allowed\n");
      return 2;
    }
    // Its rows keep their stamps and identities, so there is no live flight to imitate unless asked for.
    const double pace = options.speed_given ? *speed : std::numeric_limits<double>::infinity();
    return play_recording(options.source, {options.name, options.mission, pace}, *client.value());
  }
  auto flight = parse_uuid(options.source) ? fetch_flight(*client.value(), options.source)
                                           : read_flight_folder(options.source);
  if (!flight) {
    std::fprintf(stderr, "anchord replay: %s\n", printable(flight.error().message).c_str());
    return 2;
  }
  if (flight.value().fixes.empty() && flight.value().ranges.empty()) {
    std::fprintf(stderr, "anchord replay: %s: nothing was measured\n", options.source.c_str());
    return 2;
  }
  if (flight.value().mission.name.empty()) {
    flight.value().mission.name = std::filesystem::weakly_canonical(options.source).filename().string();
  }
  prepare_rows(flight.value());
  Result<void> result = boost::outcome_v2::success();
  do {
    result = play_once(options, *client.value(), flight.value(), *speed);
  } while (result && options.loop && !interrupted());
  if (result) return 0;
  std::fprintf(stderr, "anchord replay: %s\n", printable(result.error().message).c_str());
  return result.error().code == Errc::canceled ? 0 : 1;
}

}  // namespace

void add_replay_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "replay",
      "Replay a flight through a running server as if it were live, or decode a raw recording again");
  auto options = std::make_shared<ReplayOptions>();
  command
      ->add_option("flight", options->source,
                   "Flight folder, id of a mission on that server, or raw recording (*.anrec)")
      ->required();
  auto* url =
      command
          ->add_option("--url", options->url,
                       "URL of a running server; with a recording: the server that its rows are sent to")
          ->capture_default_str();
  command->add_option("--out", options->out,
                      "With a recording: folder for fixes.ndjson and ranges.ndjson [standard output]");
  auto* speed =
      command
          ->add_option("--speed", options->speed, "Multiple of real time, or max [1; with a recording: max]")
          ->capture_default_str();
  command->add_option("--token-file", options->token_file,
                      "File with an access token (gateway and operator)");
  command->add_option("--name", options->name, "Name of the mission [name of the flight]");
  command->add_option("--mission", options->mission,
                      "With a recording: mission on that server for its rows [the recorded ones]");
  command->add_flag("--loop", options->loop, "Repeat endlessly, each time as a new mission");
  command->callback([options, url, speed, &exit_code] {
    options->url_given = url->count() > 0;
    options->speed_given = speed->count() > 0;
    exit_code = replay(*options);
  });
}

}  // namespace anchord::cli
