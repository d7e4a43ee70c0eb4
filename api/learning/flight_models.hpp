#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "api/learning/model_registry.hpp"
#include "core/localize/correction_worth.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::api {

/// Whether a model is a likelihood of its own, or corrects alone.
inline constexpr auto k_likelihood_words = enum_table<bool>({{"one_sided", true}, {"loss", false}});
/// Whether models have to explain a flight better than its ranges as they came.
inline constexpr auto k_worth_words = enum_table<bool>({{"shown", true}, {"ignored", false}});

/// Which models correct the ranges of a calibration: per task "active", "none" or a model's id; tasks that
/// are not named are "active".
struct FlightModelsWish {
  std::map<std::string, std::string> tasks{};
  std::optional<ml::Correction> correction{};  ///< absent: the one in use
  std::optional<bool> likelihood{};  ///< the mixture's density weighs each range, not the loss alone
  bool ask_worth{true};              ///< of a flight that the models do not explain better they are left out
};
/// Noise that a person states in place of what the models were trained with.
struct StatedNoise {
  std::optional<double> los_m{}, nlos_m{};
};
/// Reads the "models" of POST /calibrations; what is wrong goes to `errors`.
FlightModelsWish read_flight_models(const nlohmann::json& models, std::vector<FieldError>& errors);

/// The models the wish means now. errors: not_found (no such model), unsupported, invalid_argument (of
/// another task), conflict (edited after it was signed, or from elsewhere and never promoted)
Result<ModelRegistry::Active> models_for(const FlightModelsWish& wish, const ModelRegistry& registry);

/// What the models did to a flight.
struct FlightModelsReport {
  std::size_t n_ranges{}, n_los{}, n_nlos{}, n_corrected{}, n_silent{};
  std::size_t n_believed{};  ///< entered the solve by the model's likelihood
  double mean_correction_m{};
  std::string note;                        ///< why some ranges were left as they came
  std::optional<CorrectionWorth> worth{};  ///< absent: not asked
  bool used{true};                         ///< false: the flight was solved without them, for want of worth
  bool spoke() const { return n_corrected + n_believed > 0; }
  /// With what they did to other ranges of the flight.
  FlightModelsReport& operator+=(const FlightModelsReport& part);
};
/// Takes the models' corrections off the ranges of `flight` (a copy of the record, never the record), and
/// tells the solver what the models believe of the error that is left.
/// likelihood  false: no error models; the solver's loss alone weighs the ranges
/// noise       stated sigmas replace those of the error models; with nlos_m a class alone makes an error
/// model too
FlightModelsReport correct_flight(const ModelRegistry::Active& models, FlightData& flight,
                                  bool likelihood = true, const StatedNoise& noise = {});

/// Asks what the corrections of each flight are worth, and gives those that cannot show any their ranges back
/// as they came, with a note on the flight. True: some did, and the flights are to be solved again.
bool leave_out_worthless(std::vector<FlightModelsReport>& reports, std::vector<FlightData>& corrected,
                         const std::vector<FlightData>& raw,
                         const std::vector<std::optional<FlightSolution>>& with,
                         const std::vector<std::optional<FlightSolution>>& without);

/// What the models did to one flight.
nlohmann::ordered_json flight_models_report_json(const FlightModelsReport& report);

/// For the provenance of a calibration: models by task, correction, and what they did to each flight.
nlohmann::ordered_json flight_models_json(const ModelRegistry::Active& models,
                                          const std::vector<FlightModelsReport>& flights);

}  // namespace anchord::api
