#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/ids.hpp"
#include "core/base/steady.hpp"
#include "core/base/time.hpp"
#include "core/types/fix.hpp"

namespace anchord::flight {

/// How a flight that records stands now. Measured times are of the rows, arrivals of the steady clock:
/// silence is a duration.
struct FlightPulse {
  MissionId mission{};
  std::string name;
  SteadyTime now{};
  std::optional<UtcTime> newest_fix{}, newest_range{};        ///< measured
  std::optional<UtcTime> first_range{};                       ///< measured; of those since the start
  std::optional<SteadyTime> fix_arrival{}, range_arrival{};   ///< newest of each
  FixClass fix{FixClass::none};                               ///< of the newest
  std::optional<UtcTime> below_float_since{}, float_since{};  ///< measured; absent while it is better
  std::optional<double> correction_age_s{};                   ///< of the newest fix, where it says
  std::optional<double> lag_s{}, lag_sigma_s{};               ///< of the joint solution
  std::optional<double>
      ahead_s{};  ///< stamps of the newest ranges are at least this much later than their arrival
  std::string_view models_withheld{};  ///< why the models' corrections are not applied, while many are not
  std::string unknown_tags{};  ///< tags that range and that the mission does not have; empty: none lately
  std::string known_tags{};    ///< those it has
  std::string models_moved{};  ///< anchors that the models move by metres
  bool as_it_happens{false};   ///< rows come about as fast as they were measured: no upload, no fast replay
};

/// Keeps what the alarms of one flight ask about. Not thread-safe.
class FlightWatch {
 public:
  using Steady = std::chrono::steady_clock::time_point;
  void note(const Fix& fix);
  void note_range(UtcTime measured, std::optional<UtcTime> received);
  /// Of a range whose tag the mission does not have: it is stored, and nothing is solved with it.
  void note_unknown_tag(NetworkId tag, UtcTime measured, const std::string& known_tags);
  void note_lag(double lag_s, double sigma_s);
  /// A range that models judged; `withheld`: why their correction was not applied, empty where it was.
  void note_model(std::string_view withheld);
  /// How far the models move an anchor, and to how much its place is known without them (95 %). With them it
  /// would hide what they do: ranges that are metres wrong agree badly, and the region grows.
  void note_moved(NetworkId anchor, std::optional<double> moved_m, double known_to_m);
  /// The flight as it stands. Call it about once a second: a flight counts as happening now once ten looks
  /// saw its measured time pass about as fast as ours, and no longer when it runs ahead (an upload, a fast
  /// replay). One that falls silent stays what it was: silence is what the alarms are about.
  FlightPulse look(UtcTime newest_measured, Steady now);

 private:
  FlightPulse pulse_;
  std::deque<std::pair<UtcTime, Steady>> looks_;
  std::deque<double> ahead_s_;             ///< of the newest ranges: stamp minus arrival
  std::deque<std::string_view> withheld_;  ///< of the newest ranges that models judged
  std::set<NetworkId> moved_;
  std::map<NetworkId, UtcTime> unknown_tags_;  ///< newest range of each
};

}  // namespace anchord::flight
