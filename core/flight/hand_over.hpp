#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <variant>

#include "core/flight/live_mission.hpp"
#include "core/flight/operations.hpp"
#include "core/flight/pilot.hpp"
#include "core/flight/position_watch.hpp"

namespace anchord::flight {

// What a mission and whoever flies by it give each other: the same in the server, whose strands and locks lie
// between them, and in simulations and replays, which drive both by calls.

/// What of a mission's events concerns who flies.
inline void report(Pilot& pilot, const MissionId& mission, const Event& event) {
  if (const auto* decided = std::get_if<RangeDecided>(&event)) pilot.on_range(mission, decided->result);
}
inline void report(Pilot& pilot, const PositionEvent& event) {
  if (const auto* believed = std::get_if<FixBelieved>(&event)) pilot.on_fix(believed->fix);
}

/// The mission whose estimates the next round decides by; none: it reads none.
inline std::optional<MissionId> wants_estimates(const Operations& operations) {
  const auto& f = operations.flight();
  const bool deciding = f && f->control.engine().state().step == procedure::Step::find_next_point;
  return deciding ? std::optional(f->mission) : std::nullopt;
}

inline PlanTargets targets_of(const Plan& plan) {
  return {plan.settings.target_sigma_m, plan.anchor_target_sigma_m};
}

/// What a mission gets of its flight: of each kind the newest, where it is another one.
struct ForMission {
  std::optional<procedure::FlightPriors> priors{};
  std::optional<PlanTargets> targets{};
  bool any() const { return priors || targets; }
};
inline void give(LiveMission& live, ForMission given) {
  if (given.priors) live.use_priors(*std::move(given.priors));
  if (given.targets) live.use_targets(*std::move(given.targets));
}

/// Which of the flight's findings its mission has: each turn and height search that was concluded, and each
/// plan, is given once. Not thread-safe.
class HandOver {
 public:
  HandOver() = default;
  /// After a round. Empty without a flight, and where nothing is new.
  ForMission take(const Operations& operations) {
    ForMission out;
    const auto& f = operations.flight();
    if (!f) return out;
    if (const auto n = operations.n_flights(); n != flight_) *this = HandOver(n);
    if (const auto n = f->control.engine().priors_version(); n != priors_) {
      priors_ = n;
      out.priors = f->priors();
    }
    if (const auto n = f->changes.n; n != changes_) {
      changes_ = n;
      out.targets = targets_of(f->plan);
    }
    return out;
  }

 private:
  explicit HandOver(std::uint64_t flight) : flight_(flight) {}
  std::uint64_t flight_{0};                 ///< Operations::n_flights()
  std::uint64_t priors_{0};                 ///< FlightEngine::priors_version()
  std::optional<std::uint64_t> changes_{};  ///< FlownChanges::n; none: of the plan that was started
};

}  // namespace anchord::flight
