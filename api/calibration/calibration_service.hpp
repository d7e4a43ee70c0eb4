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
class WorkDesk;
struct CalibrationAnswer;
struct CalibrationOrder;
struct JobEnd;

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
  std::string body_json;                                                             ///< what was read
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

/// Batch solves as jobs of kind `calibration`: this server reads the flights; they are solved here or, where
/// there is a desk, by whoever claims them; this server stores what came out. Thread-safe.
class CalibrationService {
 public:
  struct Deps {
    MeasurementStore& measurements;
    MissionStore& missions;
    SiteStore& sites;
    CalibrationStore& calibrations;
    JobService& jobs;
    JobStore& job_store;
    const Clock& clock;
    KitProfiles& profiles;
    const ModelRegistry& models;
    /// What turns and height searches of a mission's flight told; absent: nothing.
    std::function<procedure::FlightPriors(const MissionId&)> flight_priors;
    FrameStore& frames;
    ExclusionStore& exclusions;
    TrackLimits track{};                 ///< what positions are held against where the request does not say
    ContradictionWatch& contradictions;  ///< asked again after each calibration
    WorkDesk* desk{nullptr};             ///< null: nobody but this server runs jobs
  };
  explicit CalibrationService(Deps deps);

  /// queue_full when too many wait; not_found for a mission that is not there.
  Result<Job> submit(CalibrationRequest request);

 private:
  struct Prepared;
  struct Reading;
  Result<Prepared> prepare(const CalibrationRequest& request, const ModelRegistry::Active& models,
                           const Reading& reading);
  // The steps of prepare(), in their order.
  Result<void> load(const CalibrationRequest& request, const ModelRegistry::Active& models,
                    const Reading& reading, Prepared& out);
  FlightOptions options_of(const CalibrationRequest& request) const;
  Result<void> ask_kits(const CalibrationRequest& request, Prepared& out);

  Result<bool> handed_over(const CalibrationRequest& request, const Prepared& prepared, JobContext& job);
  Result<std::string> message_anew(const JobId& id);
  Result<JobEnd> take_in(const Job& job, const std::string& text);
  Result<JobEnd> keep(const JobId& job, const CalibrationOrder& order, CalibrationAnswer answer);
  Deps deps_;
};

}  // namespace anchord::api
