#pragma once

#include <optional>
#include <string>

#include "core/types/estimate.hpp"

namespace anchord {
struct Calibration;
struct Mission;
}  // namespace anchord

namespace anchord::api {

struct CalibrationApi;

/// For the provenance: SHA-256 of what a person declares of a flight and its answers rest on: what the track
/// is of, lever arms and how well they are known, kit. Its name and site are not among them.
std::string declared_sha256(const Mission& mission);

/// Gate `outdated`: fails where lever arms, kit or exclusions of a flight have been changed since it was
/// solved; its value is the number of such flights. Absent: nothing has, or the provenance of this
/// calibration does not say (before 0.2).
std::optional<Gate> outdated_gate(CalibrationApi& s, const Calibration& calibration);

}  // namespace anchord::api
