#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/planning/bounds.hpp"
#include "core/procedure/machine.hpp"
#include "core/types/fix.hpp"

namespace anchord::procedure {

/// What the aircraft may do, and when it must stop. Metres of the plan's origin.
struct SafetyLimits {
  planning::Bounds bounds;  ///< fence, no-fly areas (the outline is one), height band, keep-out
  Eigen::Vector3d home_m{0, 0, 0};
  double max_jump_m = 200;   ///< no target further than this from where the aircraft is
  double tolerance_m = 1.0;  ///< wind and control: a breach is beyond it
  double speed_mps = 2;
  double battery_per_s = 1.0 / 1200;               ///< share used in flight
  double min_battery = 0.3;                        ///< must be left above home
  double critical_battery = 0.12;                  ///< lands where it is
  double position_age_s = 2;                       ///< older: it is not known where the aircraft is
  double rtk_hold_s = 2, rtk_return_s = 10;        ///< without at least float
  double link_hold_s = 3, link_return_s = 15;      ///< autopilot silent
  double disagree_m = 3;                           ///< autopilot's position against the rover's
  double lost_hold_s = 3;                          ///< autopilot answers, and does not know where it is
  double floor_tolerance_m = 0.5;                  ///< below the band by so much, by the rover: climbs
  double low_cell_v = 3.5, critical_cell_v = 3.3;  ///< of a lithium cell under load
};

struct Refused {
  std::string code;  ///< stable word
  std::string text;  ///< with the numbers
};

/// First rule that a command breaks, seen from where the aircraft is; nothing when it may leave. Hold, return
/// and land are never refused. The straight way is judged as well as its end.
std::optional<Refused> refuse_command(const SafetyLimits& limits,
                                      const std::optional<Eigen::Vector3d>& aircraft_m,
                                      const Command& command);

/// What keeps an aircraft that stands there from taking off to this height, as refuse_command() says of it.
std::optional<Refused> refuse_take_off(const planning::Bounds& bounds, const Eigen::Vector3d& stands_m,
                                       double height_m);

/// Why it may not be there, in flight: a breach of these limits, or below the band by more than the
/// tolerance. `what` is where: "the aircraft is".
std::optional<std::string> refuse_standing(const SafetyLimits& limits, const Eigen::Vector3d& at_m,
                                           std::string_view what);

/// How things stand now. Ages in seconds.
struct Situation {
  std::optional<Eigen::Vector3d> position_m{};  ///< the rover's, else the autopilot's
  double position_age_s{};
  std::optional<Eigen::Vector3d> autopilot_m{};
  double autopilot_m_age_s{};  ///< 0 while it never said one, or flies by hand
  FixClass fix{FixClass::none};
  double since_good_fix_s{};  ///< without float or fixed
  double autopilot_silent_s{};
  std::optional<double> battery{};  ///< share, 0..1
  bool flying{false};
  bool floor{false};               ///< on its way between take-off and landing: the band's lower end counts
  int battery_warning{};           ///< the autopilot's own: 1 low, 2 critical
  std::optional<double> cell_v{};  ///< of the battery, the mean of its cells
  bool wants_rtk{true};
};

enum class Reaction : std::uint8_t { hold, return_home, land };
inline constexpr auto k_reaction_words = enum_table<Reaction>(
    {{"hold", Reaction::hold}, {"return_home", Reaction::return_home}, {"land", Reaction::land}});
constexpr std::string_view to_string(Reaction reaction) { return k_reaction_words.word(reaction); }
struct Alarm {
  Reaction reaction{};
  bool climbs{false};  ///< hold, but higher: to the lower end of the band
  std::string id;      ///< alarm of dashboard.md
  std::string text;    ///< with the numbers
};

/// The gravest thing that is wrong, or nothing. Order: battery critical, battery return margin, fence and
/// height breach, autopilot silent, position unknown, RTK lost, positions that disagree, the autopilot's
/// unknown. docs/procedure.md has the table.
std::optional<Alarm> watch(const SafetyLimits& limits, const Situation& now);

/// Share of the battery that must be left to reach home with the reserve.
double return_margin(const SafetyLimits& limits, const Eigen::Vector3d& position_m);

}  // namespace anchord::procedure
