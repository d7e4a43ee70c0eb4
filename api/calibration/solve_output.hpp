#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/localize/flight_solver.hpp"
#include "core/localize/method_comparison.hpp"

namespace anchord {

namespace api {
struct FlightModelsReport;
}

enum class SolveFormat : std::uint8_t { table, json, geojson, csv };
inline constexpr auto k_solve_format_words = enum_table<SolveFormat>({{"table", SolveFormat::table},
                                                                      {"json", SolveFormat::json},
                                                                      {"geojson", SolveFormat::geojson},
                                                                      {"csv", SolveFormat::csv}});

/// A solved flight with what it was told.
struct SolvedFlight {
  const FlightData* data{};
  const FlightSolution* solution{};
  std::map<NetworkId, MethodAnswers> methods{};  ///< positions of the dissertation's methods, for comparison
  const api::FlightModelsReport* models{nullptr};  ///< what models did to its ranges; null: none were given
};

/// Text of `anchord solve`, newline at the end. Schema in docs/formats.md; longitudes and latitudes with 9
/// decimals (0.1 mm), metres with 4. In a local frame GeoJSON features have no geometry.
std::string solve_output(std::span<const SolvedFlight> flights, SolveFormat format);

}  // namespace anchord
