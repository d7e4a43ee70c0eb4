#pragma once

#include <filesystem>
#include <string>

#include "core/base/result.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/method_comparison.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::cli {

struct SolveReportOptions {
  std::filesystem::path file;   ///< HTML to write
  std::filesystem::path truth;  ///< anchors_truth.csv to compare with; empty: none
  int iterations{8};            ///< 0: no curves
};

/// Writes the page of one solved flight (api/formats/report). errors name the file.
Result<void> write_solve_report(const FlightData& flight, const FlightSolution& solution,
                                const std::map<NetworkId, MethodAnswers>& methods,
                                const FlightOptions& options, const SolveReportOptions& report);

}  // namespace anchord::cli
