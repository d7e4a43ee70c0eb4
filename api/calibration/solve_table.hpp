#pragma once

#include <span>
#include <string>

#include "api/calibration/solve_output.hpp"

namespace anchord {

/// For eyes: one block per flight, one line per anchor, what limits it below.
std::string solve_table(std::span<const SolvedFlight> flights);
/// For spreadsheets: one row per flight and anchor; empty fields where there is no value.
std::string solve_csv(std::span<const SolvedFlight> flights);

}  // namespace anchord
