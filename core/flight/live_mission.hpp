#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/flight/events.hpp"
#include "core/flight/pulse.hpp"
#include "core/flight/rows.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/localize/flight_history.hpp"
#include "core/localize/flight_options.hpp"
#include "core/localize/live_flight.hpp"
#include "core/procedure/flight_priors.hpp"
#include "core/types/exclusion.hpp"
#include "core/types/flight_data.hpp"
#include "core/types/mission.hpp"

namespace anchord {
struct FlightSolution;
}

namespace anchord::flight {

struct LiveMissionSetup {
  Mission mission;
  LiveOptions live{};
  AccuracyGoal goal{};    ///< of anchors without a target: within it, and held back by no gate, is converged
  PlanTargets targets{};  ///< of the plan that is flown
  std::vector<Exclusion> exclusions{};
  procedure::FlightPriors priors{};  ///< what turns and height searches found before
};

/// How a mission stands, in numbers.
struct LiveState {
  std::uint64_t n_ranges{}, n_fixes{};
  std::size_t anchors_found{}, anchors_converged{};
  double range_rate_hz{};
  std::map<std::string, std::size_t> fixes_refused{};  ///< positions that are no part of the track, by reason
  std::size_t n_fixes_excluded{};
  std::optional<Wgs84> origin{};
  UtcTime time{};                    ///< of the newest measurement; creation before the first
  std::optional<UtcTime> started{};  ///< first measurement
};

/// One mission as it happens: measurements in, events out. Joins ranges to the track, keeps every estimate,
/// counts, and knows what a joint solution is made of.
///
/// Deterministic: driven by calls and measured times alone, without clock, thread, lock or output; the same
/// calls give the same events. Not thread-safe: one strand per mission owns it.
class LiveMission {
 public:
  explicit LiveMission(LiveMissionSetup setup);

  /// One row, judged by the models when it came. Ranges of tags and anchors beyond k_most_live_tags and
  /// k_most_live_anchors are counted and nothing else.
  void add(const LiveRow& row);
  /// What turns and height searches found, from the next solve on; waits for the first good fix.
  void use_priors(procedure::FlightPriors priors);
  /// Another plan is flown: every anchor is held against what it wants.
  void use_targets(PlanTargets targets);
  /// The rows of a batch are in: decided ranges and changed estimates become events.
  void settle();
  /// No more rows: ranges that wait for a fix are rejected, every anchor is solved once more. Then settle().
  void finish() { live_.finish(); }

  /// Reading what was stored: rows are joined and counted, nothing is solved and nothing new is published.
  /// end_reading() solves every anchor once and publishes the estimates.
  void begin_reading();
  void end_reading();
  /// Begins anew, less what is excluded now: rows are given again, what was solved before is not adopted.
  void begin_anew(std::vector<Exclusion> exclusions);

  /// All rows so far, for a solution of the whole flight at once.
  struct JointProblem {
    FlightData flight;
    FlightOptions options;
    UtcTime cut{};               ///< measured time of the newest row in it
    std::uint64_t generation{};  ///< of begin_anew()
  };
  /// Rows or priors came since the last problem, and there are enough for it.
  bool joint_is_worth_it() const;
  /// Where joint_is_worth_it(). `outline_m`: of the site in metres of origin(), empty where it has none.
  JointProblem joint_problem(std::vector<Eigen::Vector2d> outline_m);
  /// From the next row on it holds. False: it began anew since.
  bool adopt(const FlightSolution& solution, UtcTime cut, std::uint64_t generation);

  std::vector<Event> take_events() { return std::exchange(events_, {}); }
  bool has_events() const { return !events_.empty(); }

  const LiveState& state() const { return state_; }
  /// The statuses of all anchors that were heard.
  const std::map<NetworkId, std::string_view>& statuses() const { return statuses_; }
  std::optional<Wgs84> origin() const { return live_.origin(); }
  /// Newest answer of every anchor, with the gates of the goal.
  std::vector<Estimate> estimates() const;
  FlightWatch& watch() { return watch_; }

 private:
  void add(const PredictedRange& judged);
  void add(const Fix& fix);
  bool follows(const Range& range);
  void announce_fixes();
  void announce_estimate(Estimate estimate);
  void update_live_priors();
  void assess(Estimate& estimate) const;

  LiveMissionSetup setup_;
  LiveFlight live_;
  LiveState state_;
  FlightHistory history_;
  FlightWatch watch_;
  std::uint64_t generation_{0};
  bool reading_{false}, priors_in_use_{false};
  std::map<std::string, std::size_t> rejections_published_;
  std::map<NetworkId, std::string_view> statuses_;
  std::set<NetworkId> tags_, anchors_;  ///< that are followed
  std::deque<std::int64_t> range_times_us_;
  std::size_t ranges_since_joint_{0};
  std::vector<Event> events_;
};

}  // namespace anchord::flight
