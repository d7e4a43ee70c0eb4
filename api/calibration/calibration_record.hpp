#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "api/calibration/calibration_task.hpp"
#include "api/learning/flight_models.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/ml/predictor.hpp"
#include "core/types/anchor.hpp"
#include "core/types/local_frame.hpp"
#include "core/types/mission.hpp"

namespace anchord::api {

/// What was asked for, and what the server knew of it when its flights were read: what the record of a
/// calibration says beside the answer, and what an answer is held against. It stays with the server.
struct CalibrationOrder {
  struct Flight {
    MissionId id{};
    std::string name, kit;
    std::string exclusions_json;  ///< for the provenance
    std::string declared_sha256;  ///< for the provenance
    std::size_t n_fixes{}, n_ranges{}, n_anchor_anchor{};
    std::vector<NetworkId> anchors;  ///< that its ranges name, ascending
  };
  std::vector<Flight> flights;  ///< as the task's
  std::size_t n_answered{};
  std::string settings_json;  ///< as accepted
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Wgs84> origin{};
  struct Kit {
    std::string name;
    std::optional<std::uint64_t> version{};  ///< of its stored profile
    std::size_t n_flights{};                 ///< in that
  };
  std::vector<Kit> kits;  ///< by name; flights without a kit have none
  bool use_profile{true}, teaches{true}, compare_uncorrected{true}, ask_worth{true}, plane{false};
  int iterations{0};
  std::size_t n_priors{};  ///< anchors with a bearing or a height as a prior
  StatedNoise noise{};
  double floor_sigma_m{};
  std::optional<LocalFrame> local_frame{};  ///< the answers are given in it too
  std::string base_json{"null"}, outline_json{"null"};
  std::optional<double> base_sigma_m{};
  std::map<std::string, ModelId> models{};  ///< by task
  ml::Correction correction{};
  std::vector<FlightModelsReport> reports;  ///< what models did to each flight; empty: no models
};

/// An answer from elsewhere, held against what was asked: flights, anchors, kits and counts.
/// errors  bad_frame, naming what does not fit
Result<void> check_answer(const CalibrationOrder& order, const CalibrationAnswer& answer);

/// The calibration that an answer makes; without id and time.
/// errors  invalid_argument (the local frame has no fit)
Result<Calibration> record_of(const CalibrationOrder& order, CalibrationAnswer answer);

/// The missions of all its flights, as far as profiles tell them apart.
std::vector<Mission> missions_of(const CalibrationOrder& order);

/// For the provenance: those that applied.
std::string exclusions_json(const std::vector<Exclusion>& exclusions);

}  // namespace anchord::api
