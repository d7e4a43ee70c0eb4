#pragma once

#include <cstdint>
#include <string>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/ports/drone.hpp"

namespace anchord::flight {

/// What an operator can ask of a flight.
enum class FlightAction : std::uint8_t { start, hold, resume, skip, return_home, land, abort, disarm };
inline constexpr auto k_flight_action_words = enum_table<FlightAction>({{"start", FlightAction::start},
                                                                        {"hold", FlightAction::hold},
                                                                        {"resume", FlightAction::resume},
                                                                        {"skip", FlightAction::skip},
                                                                        {"return", FlightAction::return_home},
                                                                        {"land", FlightAction::land},
                                                                        {"abort", FlightAction::abort},
                                                                        {"disarm", FlightAction::disarm}});

/// How a flight stands, for a person.
enum class FlightStatus : std::uint8_t { ready, running, hold, returning, landing, done, aborted };
inline constexpr auto k_flight_status_words = enum_table<FlightStatus>({{"ready", FlightStatus::ready},
                                                                        {"running", FlightStatus::running},
                                                                        {"hold", FlightStatus::hold},
                                                                        {"return", FlightStatus::returning},
                                                                        {"landing", FlightStatus::landing},
                                                                        {"done", FlightStatus::done},
                                                                        {"aborted", FlightStatus::aborted}});

/// Whether a pilot flies where the screen says.
inline constexpr auto k_flight_mode_words = enum_table<bool>({{"auto", false}, {"manual", true}});

/// A command of the operator or of the procedure, and what became of it.
struct FlightCommand {
  std::uint64_t number{};
  std::string action;  ///< word of a FlightAction, or of a command of the procedure, or upload_fence, ...
  CommandState state{};
  std::string text, by;
  UtcTime at{};
  MissionId mission{};
};

/// A list given to the aircraft to keep, and what became of it.
struct FlightUpload {
  MissionId mission{};
  PlanId plan{};
  std::uint64_t revision{};
  std::string what;  ///< fence, route
  std::size_t n_items{};
  double begun_s{};
  FlightCommand command;
};

}  // namespace anchord::flight
