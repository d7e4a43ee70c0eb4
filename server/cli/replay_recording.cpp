#include "server/cli/replay_recording.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>
#include <utility>

#include "api/measurements/flight_requests.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/base/whole_file.hpp"
#include "core/types/mission.hpp"
#include "drivers/device/replay.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/replay_missions.hpp"
#include "server/cli/rest_client.hpp"
#include "server/cli/row_upload.hpp"

namespace anchord::cli {
namespace {

using SteadyClock = std::chrono::steady_clock;

// About a megabyte of rows with impulse responses: what a server takes in one gulp.
constexpr int k_batch = 500;
constexpr auto k_replay_tick = std::chrono::milliseconds(100);

std::string line_of(const Fix& fix) { return to_wire(api::fix_json(fix, std::nullopt)) + '\n'; }
std::string line_of(const Range& range) { return to_wire(api::range_json(range, std::nullopt)) + '\n'; }

/// Missions of the recording on a server: its own where the server has it, else a new one.
class Missions {
 public:
  Missions(RestClient& client, const RecordingTarget& target) : client_(client), target_(target) {}

  std::optional<MissionId> known(const MissionId& recorded) const {
    const auto found = there_.find(recorded);
    return found == there_.end() ? std::nullopt : std::optional(found->second);
  }
  /// Asks the server, and makes it there.
  Result<MissionId> find(const MissionId& recorded) {
    const auto wanted = target_.mission.empty() ? to_string(recorded) : target_.mission;
    const bool unknown = recorded == gateway::unassigned();
    if (!unknown || !target_.mission.empty()) {
      const auto there = client_.get("/api/v1/missions/" + wanted);
      if (there) {
        BOOST_OUTCOME_TRY(const auto uuid, parse_uuid(wanted));
        return there_[recorded] = MissionId{uuid};
      }
      if (there.error().code != Errc::not_found || !target_.mission.empty()) return there.error();
    }
    Mission mission;
    mission.name = target_.name;
    BOOST_OUTCOME_TRY(const auto body, client_.post("/api/v1/missions?devices=false", "application/json",
                                                    api::mission_request_json(mission),
                                                    to_string(make_uuid_v7(SystemClock{}.now()))));
    BOOST_OUTCOME_TRY(const auto id, api::parse_created_id(body));
    BOOST_OUTCOME_TRY(const auto uuid, parse_uuid(id));
    const std::string what =
        unknown ? "the rows were recorded before a mission was known: they"
                : "mission " + to_string(recorded) + " of the recording is not on this server: its rows";
    std::fprintf(
        stderr,
        "replay: %s go to the new mission %s without tags and lever arms, which a recording does not "
        "contain (use --mission with one that has them)\n",
        what.c_str(), id.c_str());
    made_.push_back(id);
    return there_[recorded] = MissionId{uuid};
  }
  Result<void> finish() {
    for (const auto& id : made_) {
      BOOST_OUTCOME_TRY(client_.post("/api/v1/missions/" + id + "/actions", "application/json",
                                     R"({"action":"finish"})", "finish-" + id));
    }
    return boost::outcome_v2::success();
  }

 private:
  RestClient& client_;
  RecordingTarget target_;
  std::map<MissionId, MissionId> there_;
  std::vector<std::string> made_;
};

/// Rows at the pace at which they were recorded, times `speed`; fixes before ranges, since a range waits on
/// the server for the fix after it.
class Player {
 public:
  Player(RestClient& client, const RecordingTarget& target)
      : upload_(client), missions_(client, target), speed_(target.speed) {}

  template <class Row>
  Result<void> take(Row row) {
    BOOST_OUTCOME_TRY(wait_for(row.received.value_or(row.time)));
    BOOST_OUTCOME_TRY(row.mission, mission_of(row.mission));
    (std::is_same_v<Row, Fix> ? batch_.fixes : batch_.ranges) += line_of(row);
    return ++batch_.n == k_batch ? send() : boost::outcome_v2::success();
  }
  Result<void> finish() {
    BOOST_OUTCOME_TRY(send());
    BOOST_OUTCOME_TRY(upload_.drain());
    return missions_.finish();
  }
  /// False when the server refused rows.
  bool report() {
    // Its failure is told by whoever sent; what was answered counts all the same.
    (void)upload_.drain();
    const auto answers = upload_.answers();
    std::fprintf(stderr, "replay: %llu rows accepted, %llu duplicates, %llu rejected\n",
                 static_cast<unsigned long long>(answers.accepted),
                 static_cast<unsigned long long>(answers.known),
                 static_cast<unsigned long long>(answers.refused));
    for (const auto* first : {&answers.first_error_fixes, &answers.first_error_ranges}) {
      if (!first->empty())
        std::fprintf(stderr, "anchord replay: first rejected: %s\n", printable(*first).c_str());
    }
    return answers.refused == 0;
  }

 private:
  /// Of the server. Asking for one that is new waits until the upload leaves the client alone.
  Result<MissionId> mission_of(const MissionId& recorded) {
    if (const auto known = missions_.known(recorded)) return *known;
    BOOST_OUTCOME_TRY(upload_.drain());
    return missions_.find(recorded);
  }
  Result<void> send() {
    sent_ = SteadyClock::now();
    return batch_.n == 0 ? boost::outcome_v2::success() : upload_.send(std::exchange(batch_, {}));
  }
  /// What is due meanwhile leaves every tick.
  Result<void> wait_for(UtcTime recorded) {
    if (interrupted()) return make_error(Errc::canceled, "stopped");
    if (std::isinf(speed_)) return boost::outcome_v2::success();
    if (!first_) {
      first_ = recorded;
      begun_ = sent_ = SteadyClock::now();
    }
    const auto due = begun_ + std::chrono::duration_cast<SteadyClock::duration>(
                                  std::chrono::duration<double>(seconds_between(*first_, recorded) / speed_));
    while (SteadyClock::now() < due) {
      const auto next = sent_ + k_replay_tick;
      std::this_thread::sleep_until(std::min(next, due));
      if (SteadyClock::now() >= next) {
        BOOST_OUTCOME_TRYV(send());
      }
      if (interrupted()) return make_error(Errc::canceled, "stopped");
    }
    return boost::outcome_v2::success();
  }

  RowBatch batch_{};
  RowUpload upload_;
  Missions missions_;
  double speed_;
  std::optional<UtcTime> first_{};
  SteadyClock::time_point begun_{}, sent_{};
};

void report(const device::ReplaySummary& s) {
  std::fprintf(stderr, "replay: %llu events, %llu fixes, %llu ranges\n",
               static_cast<unsigned long long>(s.events), static_cast<unsigned long long>(s.fixes),
               static_cast<unsigned long long>(s.ranges));
  if (s.unreadable_bytes > 0)
    std::fprintf(stderr, "replay: the last %llu bytes are incomplete and were ignored\n",
                 static_cast<unsigned long long>(s.unreadable_bytes));
  for (const auto& [reason, n] : s.dropped)
    std::fprintf(stderr, "not used: %s: %llu\n", printable(reason).c_str(),
                 static_cast<unsigned long long>(n));
}

/// Rows that no mission recorded were not stored when they came, and are not now.
bool kept(const MissionId& mission) { return mission != MissionId{}; }

template <class Take>
Result<device::ReplaySummary> each_row(const std::string& file, Take take) {
  const auto of_kind = [&](auto row) -> Result<void> {
    return kept(row.mission) ? take(std::move(row)) : boost::outcome_v2::success();
  };
  return device::replay(
      file, {[&](const Fix& row) { return of_kind(row); }, [&](const Range& row) { return of_kind(row); }});
}

/// Read twice: what a recording names last says of which mission its first rows are.
template <class Take>
Result<void> run(const std::string& file, Take take) {
  ReplayMissions missions;
  BOOST_OUTCOME_TRYV(each_row(file, [&](const auto& row) -> Result<void> {
    missions.note(row.mission);
    return interrupted() ? Result<void>(make_error(Errc::canceled, "stopped")) : boost::outcome_v2::success();
  }));
  std::set<MissionId> told;
  BOOST_OUTCOME_TRY(
      const auto done, each_row(file, [&](auto row) -> Result<void> {
        const MissionId recorded = std::exchange(row.mission, missions.of(row.mission));
        if (row.mission != recorded && told.insert(row.mission).second)
          std::fprintf(stderr,
                       "replay: rows recorded before a mission was known go to mission %s, the first one "
                       "that the recording names afterwards\n",
                       to_string(row.mission).c_str());
        return take(std::move(row));
      }));
  report(done);
  return boost::outcome_v2::success();
}

int code_of(const Error& error) {
  return error.code == Errc::canceled ? 0 : error.code == Errc::bad_frame ? 2 : 1;
}

int to_streams(const std::string& file, std::ostream& fixes, std::ostream& ranges) {
  const auto done = run(file, [&](const auto& row) -> Result<void> {
    constexpr bool fix = std::is_same_v<std::decay_t<decltype(row)>, Fix>;
    if (!((fix ? fixes : ranges) << line_of(row))) return make_error(Errc::storage_full, "cannot write rows");
    return boost::outcome_v2::success();
  });
  return done ? 0 : failed("anchord replay", done.error().message, code_of(done.error()));
}

}  // namespace

int play_recording(const std::string& file, const RecordingTarget& target, RestClient& client) {
  auto named = target;
  if (named.name.empty()) named.name = "recording " + std::filesystem::path(file).stem().string();
  Player player(client, named);
  auto done = run(file, [&](const auto& row) { return player.take(row); });
  if (done) done = player.finish();
  const bool all = player.report();
  if (!done) return failed("anchord replay", done.error().message, code_of(done.error()));
  return all ? 0 : 1;
}

int derive_recording(const std::string& file, const std::string& folder) {
  if (folder == "-") return to_streams(file, std::cout, std::cout);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  WholeFile fixes(folder + "/fixes.ndjson"), ranges(folder + "/ranges.ndjson");
  if (!fixes.out() || !ranges.out()) return failed("anchord replay", "cannot write into " + folder);
  const int code = to_streams(file, fixes.out(), ranges.out());
  for (auto* const out : {&fixes, &ranges})
    if (const auto written = out->put_in_place(); !written)
      return failed("anchord replay", written.error().message);
  return code;
}

}  // namespace anchord::cli
