#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

#include "api/anchors/frame_json.hpp"
#include "core/base/result.hpp"
#include "core/localize/flight_options.hpp"
#include "core/types/anchor.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {
class SiteStore;
class FrameStore;
}  // namespace anchord

namespace anchord::api {

/// The local frame a calibration is told in.
struct CalibrationFrame {
  LocalFrame frame;
  FrameDefinition definition;
};
/// By UUID or by name. errors: not_found, invalid_argument (never fitted)
Result<CalibrationFrame> calibration_frame(FrameStore& frames, const std::string& name_or_id);

/// Gives an estimate in metres of the frame its place on the globe. Its covariance stays that of the local
/// metres; the one of the place on the globe, what the frame's fit is uncertain included, is told by
/// frame_provenance.
void place_on_globe(const CalibrationFrame& frame, Estimate& estimate);

/// Which frame, and where it puts every anchor: {"id", "name", "version", "anchors": {id: [x, y, z]}, ...}.
/// Of flights in local metres also "globe": {id: {"cov_enu_m2", "h95_m", "v95_m"}}, accuracy of the places on
/// the globe; null where the fit does not tell how good it is (no redundant pair, no sigma).
nlohmann::json frame_provenance(const CalibrationFrame& frame, const Calibration& calibration);

/// Takes the outline of the flights' site into `options`, in the metres of the answers: anchors are inside,
/// give or take options.outline_sigma_m. Only where no outline is given, all flights name one site, and its
/// outline can be told in these metres (local ones need a fitted frame).
/// returns  for the provenance: where the outline in use comes from, or why there is none
nlohmann::json use_site_outline(bool wanted, std::span<const FlightData> flights,
                                const std::optional<Wgs84>& origin,
                                const std::optional<CalibrationFrame>& frame, SiteStore& sites,
                                FlightOptions& options);

}  // namespace anchord::api
