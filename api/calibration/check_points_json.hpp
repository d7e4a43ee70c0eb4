#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/localize/check_points.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

/// A point surveyed by other means, as a request gives it.
struct SurveyedPoint {
  NetworkId anchor{};
  std::optional<Wgs84> globe{};              ///< of flights on the globe
  std::optional<Eigen::Vector3d> local_m{};  ///< of flights in local metres
  double sigma_h_m{0.01}, sigma_v_m{0.02};
};

/// Reads `check_points` of POST /calibrations; what is wrong goes to `errors`. They never enter the solve.
std::vector<SurveyedPoint> read_check_points(const nlohmann::json& list, std::vector<FieldError>& errors);

/// For the provenance: each point's misclosure with its significance, and what all are off alike. Null
/// without points. plane: the calibration held its heights
nlohmann::json check_points_provenance(const std::vector<SurveyedPoint>& points,
                                       const Calibration& calibration, bool plane);

}  // namespace anchord::api
