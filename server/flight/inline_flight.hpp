#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/flight/hand_over.hpp"
#include "core/flight/live_mission.hpp"
#include "core/flight/operations.hpp"
#include "core/flight/position_watch.hpp"

namespace anchord::flight {

/// One live mission and whoever flies by it, joined as the server joins them (core/flight/hand_over), but
/// driven by calls: simulated missions and recordings are flown by what flies real ones, without its threads.
class InlineFlight : private Pilot {
 public:
  struct Setup {
    Mission mission;
    Plan plan;  ///< with its origin: the frame of all estimates
    double live_update_s = 4;
    bool use_priors = true;  ///< what turns and height searches told is a prior of the running estimates
  };
  /// The drone outlives it.
  InlineFlight(Setup setup, Drone& drone);

  /// A tenth of a second: what was measured goes in, then a round of procedure and safety.
  void step(const Now& now, std::span<const Fix> fixes, std::span<const Range> ranges);
  /// What an operator does who starts at once: control, every item confirmed that may be, start.
  /// errors: what blocks it
  Result<void> start(const Now& now);
  void finish();

  LiveMission& live() { return live_; }
  const std::optional<ActiveFlight>& flight() const { return operations_.flight(); }
  /// In the order in which they happened, since the last call.
  std::vector<LogEvent> take_log() { return operations_.take_events(); }
  /// Told of each event of the mission, before anything follows from it.
  std::function<void(const Event&)> on_event = [](const Event&) {};
  std::function<void(const PositionEvent&)> on_position = [](const PositionEvent&) {};

 private:
  void publish_events();
  void on_fix(const Fix& fix) override { operations_.fix(now_, fix); }
  void on_range(const MissionId& mission, const RangeResult& result) override {
    operations_.range(now_, mission, result);
  }

  Setup setup_;
  Now now_;  ///< of the present step
  PositionWatch positions_;
  LiveMission live_;
  Operations operations_;
  HandOver hand_over_;
};

}  // namespace anchord::flight
