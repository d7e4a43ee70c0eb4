#include "api/calibration/calibration_place.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/wire/outline_json.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/error_ellipse.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

/// The one site of all flights, or nothing.
std::optional<SiteId> common_site(std::span<const FlightData> flights) {
  const auto& first = flights.front().mission.site;
  const bool one = std::ranges::all_of(flights, [&](const FlightData& f) { return f.mission.site == first; });
  return one ? first : std::nullopt;
}

Json outline_provenance(const char* source, const Json& site, const FlightOptions& options,
                        const std::string& why) {
  return {{"source", source},
          {"site", site},
          {"n_corners", options.outline_m.size()},
          {"sigma_m", options.outline_m.empty() ? Json(nullptr) : Json(options.outline_sigma_m)},
          {"why", why.empty() ? Json(nullptr) : Json(why)}};
}

/// Of an estimate in local metres, once the frame has put it on the globe.
Json accuracy_on_globe(const FrameFit& fit, const Estimate& estimate) {
  const auto& local = *estimate.best;
  const auto covariance = fit.enu_covariance(local.position.m, local.covariance_m2);
  if (!covariance || !covariance->allFinite()) return nullptr;
  const auto& c = *covariance;
  const ErrorEllipse ellipse = error_ellipse(c);
  // A height with a mirror solution claims more than its covariance; so does the place on the globe.
  const double mirror_m = std::max(estimate.v95_m - error_ellipse(local.covariance_m2).v95_m, 0.0);
  return {{"cov_enu_m2", {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)}},
          {"h95_m", ellipse.h95_m},
          {"v95_m", ellipse.v95_m + mirror_m}};
}

}  // namespace

Result<CalibrationFrame> calibration_frame(FrameStore& frames, const std::string& name_or_id) {
  const auto id = parse_uuid(name_or_id);
  auto found = id ? frames.frame(FrameId{id.value()}) : frames.frame(name_or_id);
  if (!found) return make_error(found.error().code, "there is no frame " + name_or_id);
  auto definition = frame_definition(found.value());
  if (!definition)
    return make_error(Errc::invalid_argument,
                      "the frame " + name_or_id + " has not been fitted: fit it first");
  return CalibrationFrame{std::move(found).value(), *std::move(definition)};
}

void place_on_globe(const CalibrationFrame& frame, Estimate& estimate) {
  const EnuFrame globe(frame.definition.origin);
  for (auto* place : {&estimate.best, &estimate.mirror}) {
    if (*place)
      (*place)->wgs84 = globe.wgs84_from_enu({frame.definition.fit.transform.enu_from((*place)->position.m)});
  }
}

Json frame_provenance(const CalibrationFrame& frame, const Calibration& calibration) {
  const EnuFrame globe(frame.definition.origin);
  Json anchors = Json::object();
  Json accuracies = calibration.frame == TrackFrame::local && frame.definition.fit.covariance ? Json::object()
                                                                                              : Json(nullptr);
  for (const auto& estimate : calibration.anchors) {
    if (!estimate.best) continue;
    Eigen::Vector3d local_m = estimate.best->position.m;
    if (calibration.frame == TrackFrame::wgs84) {
      if (!estimate.best->wgs84) continue;
      local_m = frame.definition.fit.transform.local_from(globe.enu_from_wgs84(*estimate.best->wgs84).m);
    }
    anchors[to_string(estimate.anchor)] = {local_m.x(), local_m.y(), local_m.z()};
    if (accuracies.is_object())
      accuracies[to_string(estimate.anchor)] = accuracy_on_globe(frame.definition.fit, estimate);
  }
  return {{"id", to_string(frame.frame.id)}, {"name", frame.frame.name},
          {"version", frame.frame.version},  {"fit_rms_m", frame.definition.fit.rms_m},
          {"anchors", std::move(anchors)},   {"globe", std::move(accuracies)}};
}

Json use_site_outline(bool wanted, std::span<const FlightData> flights, const std::optional<Wgs84>& origin,
                      const std::optional<CalibrationFrame>& frame, SiteStore& sites,
                      FlightOptions& options) {
  if (!options.outline_m.empty()) return outline_provenance("request", nullptr, options, "");
  if (!wanted) return outline_provenance("none", nullptr, options, "switched off by site_outline");
  const auto site_id = common_site(flights);
  if (!site_id) return outline_provenance("none", nullptr, options, "the flights have no common site");
  const Json id = to_string(*site_id);
  const auto site = sites.site(*site_id);
  if (!site || site.value().outline.empty())
    return outline_provenance("none", id, options, "the site has no outline");
  if (!origin && !frame)
    return outline_provenance(
        "none", id, options, "the flights are in local metres, and no frame is given to convert the outline");
  options.outline_m = outline_in_enu(site.value().outline, origin ? *origin : frame->definition.origin);
  if (!origin) {
    for (Eigen::Vector2d& corner : options.outline_m) {
      const Eigen::Vector3d enu_m(corner.x(), corner.y(), 0);
      corner = frame->definition.fit.transform.local_from(enu_m).head<2>();
    }
  }
  if (options.outline_m.size() < 3) {
    options.outline_m.clear();
    return outline_provenance("none", id, options, "the site's outline is not a polygon");
  }
  return outline_provenance("site", id, options, "");
}

}  // namespace anchord::api
