#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/geo/enu.hpp"
#include "core/planning/local_plan.hpp"
#include "core/planning/plan_change.hpp"
#include "core/ports/drone.hpp"
#include "core/procedure/flight_engine.hpp"
#include "core/types/plan.hpp"

namespace anchord::flight {

/// The waypoint that the aircraft was at when its plan was changed: it is finished as it was begun, and is in
/// the list that is flown in place of the plan's own, or, `extra`, before all of them.
struct KeptPlace {
  PlanWaypoint waypoint;
  std::size_t at{};
  bool extra{false};
};

/// The list that is flown: the plan's waypoints, with the kept one in its place.
std::vector<PlanWaypoint> flown_waypoints(const Plan& plan, const std::optional<KeptPlace>& kept);

/// Limits and steps of a flight by this plan, about `home_m`. Areas that the autopilot was given stay closed,
/// whatever the plan says now.
/// errors  as procedure::flight_setup
Result<procedure::FlightSetup> setup_of(const Plan& plan, const std::optional<KeptPlace>& kept,
                                        const std::optional<DroneFence>& autopilot_keeps,
                                        const Eigen::Vector3d& home_m);

/// How a flight stands, as far as a change of its plan is concerned. A copy: what follows is long.
struct ChangeBasis {
  Plan plan;              ///< that is flown, with its origin
  bool own_origin{true};  ///< the stored plan says where its ground is; else where the aircraft took off
  std::optional<KeptPlace> kept;
  std::optional<DroneFence> autopilot_keeps;
  EnuFrame frame;
  Eigen::Vector3d home_m{0, 0, 0};
  procedure::Step step{};
  std::size_t waypoint{};
  bool next_is_current{false};
  std::optional<Eigen::Vector3d> position_m{};
  std::optional<double> battery{};
  double flown_s{};
  bool decides_apart{false};
  std::uint64_t n_flight{}, n_changes{};  ///< which state of which flight this is
};

/// A change of plan, as it would be flown from here.
struct PlanProposal {
  Plan plan;  ///< with the origin that the flight has
  planning::PlanChange change;
  std::optional<KeptPlace> kept;
  std::size_t waypoint{};  ///< of the list that is flown from then on: where the aircraft is
  std::size_t next{};      ///< of that list: flown to next
  std::optional<procedure::FlightSetup> setup;  ///< none: not even a plan
  planning::FlightTime before_s, after_s;       ///< still to fly
  std::vector<std::string> refused;             ///< why it cannot be taken; empty: it can
  std::vector<std::string> notes;               ///< what a person should know who takes it
};

PlanProposal propose_change(const ChangeBasis& now, const Plan& wanted);

/// What must hold where the aircraft is at the very moment: that it may be there, that it can reach the next
/// waypoint, and that it comes home.
std::vector<std::string> refuse_from_here(const PlanProposal& proposal,
                                          const std::optional<Eigen::Vector3d>& position_m);

}  // namespace anchord::flight
