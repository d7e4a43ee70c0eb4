#include "api/calibration/datum_change.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/error_ellipse.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

constexpr double k_most_m = 1000;  // WGS 72 and WGS 84 are 6 m apart; old national datums some hundred

std::optional<Wgs84> read_place(const Json& value, const std::string& at, std::vector<FieldError>& errors) {
  Fields fields(value, at, errors);
  const auto lon_deg = fields.number("lon", -180, 180, true);
  const auto lat_deg = fields.number("lat", -90, 90, true);
  const auto height_m = fields.number("h_m", -500, 9000, true);
  fields.finish();
  if (!lon_deg || !lat_deg || !height_m) return std::nullopt;
  return Wgs84{*lat_deg, *lon_deg, *height_m};
}

std::optional<Eigen::Vector3d> read_shift(const Json& value, std::vector<FieldError>& errors) {
  Fields fields(value, "/shift", errors);
  const auto east_m = fields.number("east_m", -k_most_m, k_most_m, true);
  const auto north_m = fields.number("north_m", -k_most_m, k_most_m, true);
  const auto up_m = fields.number("up_m", -k_most_m, k_most_m, true);
  fields.finish();
  if (!east_m || !north_m || !up_m) return std::nullopt;
  return Eigen::Vector3d(*east_m, *north_m, *up_m);
}

std::optional<DatumRequest::Mark> read_mark(const Json& value, std::vector<FieldError>& errors) {
  DatumRequest::Mark mark;
  Fields fields(value, "/mark", errors);
  if (const auto text = fields.text("anchor", 20)) {
    const auto id = parse_network_id(*text);
    if (id)
      mark.anchor = id.value();
    else
      fields.error("anchor", "bad_id", id.error().message);
  }
  const Json* measured = fields.child("measured");
  if (measured != nullptr) mark.measured = read_place(*measured, "/mark/measured", errors);
  if ((measured != nullptr) == fields.has("anchor"))
    fields.error("measured", "conflict", "give where the mark is now: either anchor or measured");
  std::optional<Wgs84> known;
  if (const Json* at = fields.child("known"))
    known = read_place(*at, "/mark/known", errors);
  else
    fields.error("known", "required", "known is missing: give the true position of the mark");
  fields.finish();
  if (!known) return std::nullopt;
  mark.known = *known;
  return mark;
}

std::optional<DatumChange> read_helmert(const Json& value, std::vector<FieldError>& errors) {
  const std::size_t before = errors.size();
  DatumChange change;
  Fields fields(value, "/helmert", errors);
  const char* const translations[] = {"tx_m", "ty_m", "tz_m"};
  const char* const rotations[] = {"rx_arcsec", "ry_arcsec", "rz_arcsec"};
  for (int i = 0; i < 3; ++i) {
    change.translation_m[i] = fields.number(translations[i], -k_most_m, k_most_m, true).value_or(0);
    change.rotation_arcsec[i] = fields.number(rotations[i], -60, 60).value_or(0);
  }
  change.scale_ppm = fields.number("scale_ppm", -100, 100).value_or(0);
  // Both signs are in use, and a table does not tell which it has.
  const bool turns = !change.rotation_arcsec.isZero(0);
  const auto position_vector = fields.word("convention", k_rotation_words, turns);
  if (position_vector && !*position_vector) change.rotation_arcsec = -change.rotation_arcsec;
  fields.finish();
  if (errors.size() != before) return std::nullopt;
  return change;
}

}  // namespace

DatumRequest read_datum_request(const Json& body, std::vector<FieldError>& errors) {
  DatumRequest out;
  Fields fields(body, "", errors);
  int given = 0;
  if (const Json* shift = fields.child("shift")) {
    ++given;
    out.shift_enu_m = read_shift(*shift, errors);
  }
  if (const Json* mark = fields.child("mark")) {
    ++given;
    out.mark = read_mark(*mark, errors);
  }
  if (const Json* helmert = fields.child("helmert")) {
    ++given;
    out.helmert = read_helmert(*helmert, errors);
  }
  if (given != 1) fields.error("", "conflict", "give the change in one way: shift, mark or helmert");
  out.sigma_m = fields.number("sigma_m", 0, 100).value_or(0);
  out.note = fields.text("note", record_limits::k_note, true).value_or("");
  fields.finish();
  return out;
}

Estimate in_datum(const PublishedPosition& before, const DatumChange& change, double sigma_m,
                  const Wgs84& origin) {
  const EnuFrame to(origin);
  Estimate out = before.estimate;
  for (auto* hypothesis : {&out.best, &out.mirror}) {
    if (!*hypothesis || !(*hypothesis)->wgs84) continue;
    Hypothesis& h = **hypothesis;
    const EnuFrame from(before.origin.value_or(*h.wgs84));
    h.wgs84 = change.wgs84(*h.wgs84);
    h.position = to.enu_from_wgs84(*h.wgs84);
    h.covariance_m2 =
        from.covariance_in(to, h.covariance_m2) + sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  }
  if (out.best) {
    const ErrorEllipse ellipse = error_ellipse(out.best->covariance_m2);
    // What else the radius holds, such as both sides of a plane, it goes on to hold.
    out.h95_m = std::max(out.h95_m, ellipse.h95_m);
    out.v95_m = std::max(out.v95_m, ellipse.v95_m);
  }
  return out;
}

}  // namespace anchord::api
