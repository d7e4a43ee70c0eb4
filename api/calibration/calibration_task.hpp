#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "api/formats/evidence.hpp"
#include "api/learning/flight_models.hpp"
#include "core/base/result.hpp"
#include "core/localize/flight_options.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/kit_profile.hpp"
#include "core/types/flight_data.hpp"

/// A batch solve apart from every store: values in, values out, the same wherever it runs.
namespace anchord::api {

struct CalibrationTask {
  /// Those that are answered, in the order of the request; behind them those that only tell bias and lag.
  /// What models say of their ranges is taken off already.
  std::vector<FlightData> flights;
  std::size_t n_answered{};
  FlightOptions options;
  /// What is known of a kit before.
  struct Kit {
    std::string name;
    std::optional<KitProfile> profile{};         ///< without what these flights said themselves
    std::map<NetworkId, AnchorPriors> priors{};  ///< of the request and of the kit's flights
  };
  std::vector<Kit> kits;                   ///< of every flight, by name
  bool use_profile{true};                  ///< and learn from these flights
  int iterations{0};                       ///< of the course of the first flight
  std::vector<FlightModelsReport> models;  ///< what they did to each flight; empty: no models
  bool compare_uncorrected{true}, ask_worth{true};
};

/// Of a flight's solution what a calibration keeps or fuses.
struct FlightAnswer {
  struct Anchor {
    Estimate estimate;
    std::optional<ErrorBudget> budget{};
  };
  std::vector<Anchor> anchors;        ///< by network id
  std::vector<Estimate> uncorrected;  ///< without the models; empty: not asked
  FlightEvidence evidence;
  std::map<std::string, std::size_t> fixes_refused;
  /// Which flight of the task has its ranges already, of whatever kit: then this one tells nothing anew.
  std::optional<std::uint64_t> copy_of{};
};

struct CalibrationAnswer {
  std::vector<FlightAnswer> flights;  ///< those of the task that are answered
  std::vector<KitProfile> learned;
  /// As the task's, with what they are worth.
  std::vector<FlightModelsReport> models;
  Convergence course;
};

/// Told between the solves: 0 to 1, of all of them.
using CalibrationProgress = std::function<void(double fraction, const std::string& detail)>;

/// task    its flights are solved in place: nothing is left of them to be solved again
/// errors  those of solve_flights and convergence_of; canceled (CalibrationTask::options)
/// threads pure
Result<CalibrationAnswer> solve_calibration(CalibrationTask& task, const CalibrationProgress& progress);

/// Whether a flight that is solved with these settings says the same about its kit as with the house's.
bool teaches(const FlightOptions& options);

/// Whether the kits' stored profiles told anything: they know the bias of raw ranges, and of corrected ones
/// they would take it off twice.
bool profiles_used(bool wanted, const std::vector<FlightModelsReport>& models);

}  // namespace anchord::api
