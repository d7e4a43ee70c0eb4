#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "api/kit/problem.hpp"
#include "api/learning/flight_models.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/localize/flight_options.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/site_store.hpp"
#include "core/procedure/flight_priors.hpp"
#include "core/types/anchor.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {
class FrameStore;
}

namespace anchord::api {

class ContradictionWatch;
class JobContext;
class KitProfiles;
class JobService;

/// Where the search of each anchor begins: true at its bearing and height.
inline constexpr auto k_initial_words = enum_table<bool>({{"search", false}, {"bearing_height", true}});
/// Whether the profile of the kit is used.
inline constexpr auto k_profile_words = enum_table<bool>({{"kit", true}, {"none", false}});

/// A batch solve as asked for.
struct CalibrationRequest {
  std::vector<MissionId> missions;
  std::vector<MissionId>
      learn_from;  ///< other flights of the same kit: they tell its bias and lag, not positions
  FlightOptions options;
  std::string settings_json;                                                         ///< as accepted
  std::optional<double> max_correction_age_s, max_speed_mps, max_acceleration_mps2;  ///< else the service's
  bool use_profile{true};     ///< the kit's stored profile tells the prior, and learns from these flights
  int iterations{0};          ///< growing parts of each flight solved too, for the report's curves
  FlightModelsWish models{};  ///< what corrects the ranges before anything is solved
  bool flight_priors{true};   ///< bearings and heights that the flights found are priors
  StatedNoise noise{};        ///< sigma_m
  bool likelihood{true};      ///< of the models, where they have one
  bool compare_uncorrected{true};  ///< the positions without the models are kept beside
  bool use_anchor_anchor{true};    ///< ranges between anchors take part
  bool site_outline{true};         ///< the outline of the missions' site is a prior, where none is given
  std::string frame;               ///< name or id of the local frame the answers are told in too
};

/// Reads the body of POST /calibrations; what is wrong is appended to `errors`.
CalibrationRequest read_calibration_request(const nlohmann::json& body, std::vector<FieldError>& errors);

/// Batch solves as jobs of kind `calibration`. Thread-safe.
class CalibrationService {
 public:
  struct Deps {
    MeasurementStore& measurements;
    MissionStore& missions;
    SiteStore& sites;
    CalibrationStore& calibrations;
    JobService& jobs;
    const Clock& clock;
    KitProfiles& profiles;
    const ModelRegistry& models;
    /// What turns and height searches of a mission's flight told; absent: nothing.
    std::function<procedure::FlightPriors(const MissionId&)> flight_priors;
    FrameStore& frames;
    ExclusionStore& exclusions;
    TrackLimits track{};                 ///< what positions are held against where the request does not say
    ContradictionWatch& contradictions;  ///< asked again after each calibration
  };
  explicit CalibrationService(Deps deps) : deps_(deps) {}

  /// queue_full when too many wait; not_found for a mission that is not there.
  Result<Job> submit(CalibrationRequest request);

 private:
  /// A calibration and what the profiles of its kits should learn from it.
  struct Solved;
  Result<Solved> solve(const CalibrationRequest& request, const ModelRegistry::Active& models,
                       JobContext& job);
  // The steps of solve(), in their order.
  Result<void> load(const CalibrationRequest& request, const ModelRegistry::Active& models, JobContext& job,
                    Solved& solved);
  FlightOptions options_of(const CalibrationRequest& request, JobContext& job) const;
  /// `raw`: the same without the models, where it is compared or their worth is asked for; else it stays
  /// empty.
  Result<void> solve_by_models(const CalibrationRequest& request, const FlightOptions& options,
                               JobContext& job, Solved& solved, Solved& raw);
  void conclude(const CalibrationRequest& request, const ModelRegistry::Active& models, Solved& solved,
                const Solved& raw) const;

  Result<void> solve_kits(const CalibrationRequest& request, const FlightOptions& options, Solved& solved);
  Result<void> solve_kit(const CalibrationRequest& request, const FlightOptions& options, Solved& solved,
                         const std::string& kit);
  Deps deps_;
};

}  // namespace anchord::api
