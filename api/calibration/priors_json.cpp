#include "api/calibration/priors_json.hpp"

#include <nlohmann/json.hpp>
#include <numbers>

#include "api/formats/flight_json.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_far_m = 20'000;  // of the origin, as for the track

void read_outline(const nlohmann::json& list, const std::string& at, FlightOptions& options,
                  std::vector<FieldError>& errors) {
  if (!list.is_array() || list.size() < 3 || list.size() > 1000) {
    errors.push_back({at, "out_of_range", "must be 3 to 1000 corners, each [east, north] in metres"});
    return;
  }
  for (const auto& corner : list) {
    const bool good =
        corner.is_array() && corner.size() == 2 && corner[0].is_number() && corner[1].is_number();
    const Eigen::Vector2d point = good ? Eigen::Vector2d(corner[0].get<double>(), corner[1].get<double>())
                                       : Eigen::Vector2d(2 * k_far_m, 0);
    if (!(point.norm() < k_far_m)) {
      errors.push_back({at, "out_of_range", "a corner must be [east, north] in metres, within 20 km"});
      return;
    }
    options.outline_m.push_back(point);
  }
}

void read_anchor(const nlohmann::json& value, const std::string& at, AnchorPriors& priors,
                 std::vector<FieldError>& errors) {
  Fields fields(value, at, errors);
  if (const auto* bearing = fields.child("bearing")) {
    Fields inner(*bearing, at + "/bearing", errors);
    AnchorPriors::Bearing out;
    const auto from = inner.numbers("from_m", 3, -k_far_m, k_far_m, true);
    const auto degrees = inner.number("bearing_deg", -360, 360, true);
    if (const auto sigma = inner.number("sigma_deg", 1, 180)) out.sigma_rad = *sigma * k_degree;
    inner.finish();
    if (from && degrees) {
      out.tag_m = {(*from)[0], (*from)[1], (*from)[2]};
      out.bearing_rad = *degrees * k_degree;
      priors.bearing = out;
    }
  }
  if (const auto* height = fields.child("height")) {
    Fields inner(*height, at + "/height", errors);
    AnchorPriors::Height out;
    const auto up = inner.number("up_m", -1000, 10'000, true);
    if (const auto sigma = inner.number("sigma_m", 0.01, 100)) out.sigma_m = *sigma;
    inner.finish();
    if (up) {
      out.up_m = *up;
      priors.height = out;
    }
  }
  fields.finish();
}

}  // namespace

void read_priors(const nlohmann::json& value, const std::string& base, FlightOptions& options,
                 std::vector<FieldError>& errors) {
  Fields fields(value, base, errors);
  if (const auto* outline = fields.child("outline_m"))
    read_outline(*outline, base + "/outline_m", options, errors);
  if (const auto sigma = fields.number("outline_sigma_m", 0.1, 100)) options.outline_sigma_m = *sigma;
  if (const auto sigma = fields.number("rss_sigma_db", 1, 30)) options.level_sigma_db = *sigma;
  if (const auto* anchors = fields.child("anchors")) {
    if (!anchors->is_object() || anchors->size() > 1000) {
      errors.push_back({base + "/anchors", "wrong_type", "must be an object: anchor id -> its priors"});
    } else {
      for (const auto& [id, priors] : anchors->items()) {
        const std::string at = base + "/anchors/" + to_utf8(id, 40);
        read_anchor(priors, at, options.priors[network_id_of(id)], errors);
      }
    }
  }
  fields.finish();
}

}  // namespace anchord::api
