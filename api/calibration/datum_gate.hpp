#pragma once

#include <map>
#include <memory>
#include <optional>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/types/estimate.hpp"

namespace anchord {
struct Calibration;
}

namespace anchord::api {

struct CalibrationApi;

/// Which of the calibrations behind revisions are changes of a datum; they never change, and are read once.
using DatumChanges = std::shared_ptr<Locked<std::map<CalibrationId, bool>>>;

/// Gate `datum`: fails for a calibration of flights that were made before the newest change of their site's
/// datum (POST /sites/{id}/datum). Its coordinates are the former ones, by what may be less than `moved` can
/// see. Absent: the datum of the site was never changed, or this is the change.
std::optional<Gate> datum_gate(CalibrationApi& s, const Calibration& calibration);

}  // namespace anchord::api
