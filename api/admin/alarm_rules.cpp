#include "api/admin/alarm_rules.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace anchord::api {
namespace {

// dashboard.md section 6
constexpr double k_lost_s = 2, k_float_s = 5, k_silent_ranges_s = 5, k_old_corrections_s = 10;
constexpr double k_skew_s = 0.05;
constexpr double k_ahead_s =
    1;  ///< nothing arrives before it was measured; 1 s for clocks that NTP has yet to set
// A receiver may take so long to its first fix after it was switched on with the tag.
constexpr double k_never_s = 20;
// reliability.md section 2: warn at 2 GiB free, refuse new flights at 500 MiB
constexpr std::uint64_t k_low_bytes = 2ULL << 30, k_refuse_bytes = 500ULL << 20;
// Two seconds of the fastest ingest: what a writer that keeps up never lets wait.
constexpr std::uint64_t k_many_rows = 40'000;
// From where on silence of both may be the end of a flight that nobody finished; nothing here can know.
constexpr double k_perhaps_over_s = 30;

double silence_s(const std::optional<SteadyTime>& arrival, SteadyTime now) {
  return arrival ? seconds_between(*arrival, now) : 1e9;
}

bool holds_for(const std::optional<UtcTime>& since, const std::optional<UtcTime>& newest, double seconds) {
  return since && newest && seconds_between(*since, *newest) > seconds;
}

void rtk(const FlightPulse& f, std::vector<AlarmCondition>& out) {
  const double fixes_s = silence_s(f.fix_arrival, f.now);
  const bool behind =
      !f.newest_fix || !f.newest_range || seconds_between(*f.newest_fix, *f.newest_range) > k_lost_s;
  const bool nothing = silence_s(f.range_arrival, f.now) > k_silent_ranges_s;
  if (!f.newest_fix && holds_for(f.first_range, f.newest_range, k_never_s) && !nothing) {
    out.push_back({"rtk.lost", AlarmPriority::critical,
                   f.name + ": ranges are received, but no position yet, and without positions no anchor "
                            "can be located: is the rover connected, and does it have a fix?",
                   f.mission});
  } else if (f.newest_fix && fixes_s > k_lost_s && (behind || nothing)) {
    const bool perhaps_over = std::min(fixes_s, silence_s(f.range_arrival, f.now)) > k_perhaps_over_s;
    out.push_back(
        {"rtk.lost", AlarmPriority::critical,
         f.name + (perhaps_over ? ": no positions and no ranges; check power and cables of rover and tag, or "
                                  "finish the flight if it is over"
                                : ": no position from the rover"),
         f.mission});
  } else if (holds_for(f.below_float_since, f.newest_fix, k_lost_s)) {
    out.push_back({"rtk.lost", AlarmPriority::critical, f.name + ": RTK lost, ranges are stored but not used",
                   f.mission});
  } else if (f.correction_age_s && *f.correction_age_s > k_old_corrections_s) {
    out.push_back(
        {"rtk.lost", AlarmPriority::critical, f.name + ": no corrections for more than 10 s", f.mission});
  } else if (holds_for(f.float_since, f.newest_fix, k_float_s) && !nothing) {
    out.push_back({"rtk.float", AlarmPriority::warning, f.name + ": RTK is FLOAT, ranges are weighted less",
                   f.mission});
  }
}

void ranges(const FlightPulse& f, std::vector<AlarmCondition>& out) {
  if (!f.newest_range || silence_s(f.range_arrival, f.now) <= k_silent_ranges_s) return;
  out.push_back({"uwb.none", AlarmPriority::warning, f.name + ": no ranges for more than 5 s", f.mission});
}

void tags(const FlightPulse& f, std::vector<AlarmCondition>& out) {
  if (f.unknown_tags.empty()) return;
  out.push_back({"uwb.tag", AlarmPriority::warning,
                 f.name + ": ranges of tag " + f.unknown_tags + " are stored and not used, the mission has " +
                     (f.known_tags.empty() ? "none" : f.known_tags) +
                     ": correct the tags of the mission, or put its tag on the aircraft",
                 f.mission});
}

void clock(const FlightPulse& f, std::vector<AlarmCondition>& out) {
  if (f.ahead_s && *f.ahead_s > k_ahead_s) {
    out.push_back(
        {"clock.skew", AlarmPriority::warning,
         f.name +
             ": ranges are stamped later than they arrive, by more than 1 s: set the clock of the computer "
             "that stamps them (NTP), or this one's",
         f.mission});
    return;
  }
  if (!f.lag_s || std::abs(*f.lag_s) - 2 * f.lag_sigma_s.value_or(0) <= k_skew_s) return;
  char text[96];
  std::snprintf(text, sizeof text, ": the clocks of tag and rover differ by %.1f s", *f.lag_s);
  out.push_back({"clock.skew", AlarmPriority::warning, f.name + text, f.mission});
}

void models(const FlightPulse& f, std::vector<AlarmCondition>& out) {
  if (!f.models_withheld.empty())
    out.push_back({"model.withheld", AlarmPriority::warning,
                   f.name + ": corrections of the promoted models are not applied, " +
                       std::string(f.models_withheld) +
                       "; train on ranges like these, or roll the model back",
                   f.mission});
  if (!f.models_moved.empty())
    out.push_back({"model.moved", AlarmPriority::warning,
                   f.name + ": the promoted models move anchors by more than 3 m (" + f.models_moved +
                       "); compare with the positions without them, or roll the model back",
                   f.mission});
}

}  // namespace

std::vector<AlarmCondition> alarm_conditions(const std::vector<FlightPulse>& flights,
                                             const ServerPulse& server) {
  std::vector<AlarmCondition> out;
  if (!server.writable) out.push_back({"storage.unwritable", AlarmPriority::critical, server.reason, {}});
  if (server.stalled) {
    out.push_back(
        {"storage.stalled",
         AlarmPriority::critical,
         server.reason +
             ". Measurements of devices wait in memory and are in the raw recording; the flight continues",
         {}});
  }
  if (server.disk_free_bytes > 0 && server.disk_free_bytes < k_low_bytes) {
    out.push_back({"disk.low",
                   AlarmPriority::warning,
                   server.disk_free_bytes < k_refuse_bytes
                       ? "less than 500 MiB free on the disk: no new flight can start; free some space"
                       : "less than 2 GiB free on the disk of the data: free some space soon",
                   {}});
  }
  if (server.queued_rows > k_many_rows) {
    out.push_back(
        {"queue.behind",
         AlarmPriority::warning,
         "measurements arrive faster than they can be processed; all are stored, live values are late",
         {}});
  }
  if (!server.failed_tasks.empty()) {
    out.push_back({"server.task_failed",
                   AlarmPriority::warning,
                   "a task of the server failed, the server continues; details are in the log, send it with "
                   "a report: " +
                       server.failed_tasks,
                   {}});
  }
  if (!server.clock_skew.empty())
    out.push_back({"clock.skew", AlarmPriority::warning, server.clock_skew, {}});
  if (!server.not_started.empty())
    out.push_back({"device.not_started", AlarmPriority::warning, server.not_started, {}});
  if (!server.not_backed_up.empty())
    out.push_back({"backup.failed",
                   AlarmPriority::warning,
                   "the last backup failed, and the next attempt follows: " + server.not_backed_up,
                   {}});
  if (!server.unrecorded.empty()) {
    out.push_back({"recording.failed",
                   AlarmPriority::critical,
                   "raw bytes of the devices are not recorded: " + server.unrecorded,
                   {}});
  }
  for (const auto& f : flights) {
    if (!f.as_it_happens) continue;
    rtk(f, out);
    ranges(f, out);
    tags(f, out);
    clock(f, out);
    models(f, out);
  }
  return out;
}

}  // namespace anchord::api
