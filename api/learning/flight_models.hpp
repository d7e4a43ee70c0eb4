#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/http/problem.hpp"
#include "api/learning/model_registry.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::api {

/// Which models correct the ranges of a calibration: per task "active", "none" or a model's id; tasks that
/// are not named are "active".
struct FlightModelsWish {
  std::map<std::string, std::string> tasks{};
  std::optional<ml::Correction> correction{};  ///< absent: the one in use
};
/// Reads the "models" of POST /calibrations; what is wrong goes to `errors`.
FlightModelsWish read_flight_models(const nlohmann::json& models, std::vector<FieldError>& errors);

/// The models the wish means now. errors: not_found (no such model), unsupported, invalid_argument (of
/// another task)
Result<ModelRegistry::Active> models_for(const FlightModelsWish& wish, const ModelRegistry& registry,
                                         ModelStore& store);

/// What the models did to a flight.
struct FlightModelsReport {
  std::size_t n_ranges{}, n_los{}, n_nlos{}, n_corrected{}, n_silent{};
  double mean_correction_m{};
  std::string note;  ///< why some ranges were left as they came
};
/// Takes the models' corrections off the ranges of `flight` (a copy of the record, never the record).
FlightModelsReport correct_flight(const ModelRegistry::Active& models, FlightData& flight);

/// For the provenance of a calibration: models by task, correction, and what they did to each flight.
nlohmann::ordered_json flight_models_json(const ModelRegistry::Active& models,
                                          const std::vector<FlightModelsReport>& flights);

}  // namespace anchord::api
