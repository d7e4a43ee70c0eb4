#pragma once

#include <cstdint>
#include <string>

#include "core/base/ids.hpp"
#include "core/base/time.hpp"

namespace anchord::flight {

/// A command of the operator or of the procedure, and what became of it.
struct FlightCommand {
  std::uint64_t number{};
  std::string action;  ///< start, hold, resume, skip, return, land, abort, or go_to of the procedure
  std::string state;   ///< sent, accepted, refused, unconfirmed
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
