#pragma once

#include <Eigen/Core>

#include "core/base/result.hpp"
#include "core/geo/source_crs.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {

/// Metres from zero beyond which coordinates are of a map or earth-centred, and no local frame's; as of the
/// rows of the API.
inline constexpr double k_most_local_m = 1e5;
inline constexpr const char* k_of_a_map =
    "beyond 100 km of zero: that is a map (UTM, a national grid) or earth-centred coordinates, whose system "
    "is needed";

inline bool is_of_a_map(const Eigen::Vector3d& at_m) { return at_m.cwiseAbs().maxCoeff() > k_most_local_m; }

/// What directions of a track are measured from.
enum class AttitudeOf : std::uint8_t { axes, true_north };

/// Puts a track whose local_m are coordinates of another system on the globe. Covariances, and attitudes of
/// its axes, are turned into ENU by the convergence. Adds notes: the system, what the heights are above, the
/// error of the datum, how many positions were outside of it and left out. errors  those of SourceCrs::open;
/// invalid_argument (no position; attitudes of earth-centred axes)
Result<void> put_on_globe(FlightData& flight, const SourceCrsSpec& spec, AttitudeOf attitude);

}  // namespace anchord
