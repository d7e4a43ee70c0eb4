#include "api/anchors/anchor_kml.hpp"

#include <cstdio>

#include "api/formats/report.hpp"
#include "api/wire/live_writer.hpp"

namespace anchord::api {
namespace {

std::string kml_number(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

std::string data(const char* name, std::string_view value) {
  return std::string("<Data name=\"") + name + "\"><value>" + html_text(value) + "</value></Data>";
}

std::string placemark(const AnchorFeature& feature) {
  const auto& estimate = *feature.estimate;
  const auto& at = *estimate.best->wgs84;
  const GlobeAccuracy place = map_accuracy(feature).value_or(GlobeAccuracy{});
  const bool sea_level = feature.height_orthometric_m.has_value();
  const std::string id = to_string(feature.anchor.network_id);
  std::string out = "<Placemark id=\"a" + id + "\"><name>" +
                    html_text(feature.anchor.name.empty() ? id : feature.anchor.name) + "</name>";
  if (!sea_level) out += "<description>Height is ellipsoidal; no geoid is installed.</description>";
  std::string failed;
  for (const auto& gate : estimate.gates) {
    if (!gate.passed) failed += (failed.empty() ? "" : " ") + gate.name;
  }
  out += "<ExtendedData>" + data("network_id", id) + data("status", feature.status) +
         data("revision", feature.revision ? std::to_string(*feature.revision) : "") +
         data("h_ellipsoidal_m", kml_number(at.height_m, 4)) + data("h95_m", kml_number(place.h95_m, 4)) +
         data("v95_m", kml_number(place.v95_m, 4)) + data("verdict", k_verdict_words.word(estimate.verdict)) +
         data("gates_failed", failed) +
         data("override_reason", feature.overridden ? feature.overridden->reason : "") +
         data("frame", feature.site ? feature.site->crs_frame : "") + "</ExtendedData>";
  out += std::string("<Point><altitudeMode>") + (sea_level ? "absolute" : "clampToGround") +
         "</altitudeMode><coordinates>" + kml_number(at.lon_deg, 9) + ',' + kml_number(at.lat_deg, 9);
  if (sea_level) out += ',' + kml_number(*feature.height_orthometric_m, 4);
  return out + "</coordinates></Point></Placemark>\n";
}

}  // namespace

std::string anchors_kml(const std::vector<AnchorFeature>& features) {
  std::string out =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml "
      "xmlns=\"http://www.opengis.net/kml/2.2\"><Document><name>UWB anchors</name>\n";
  for (const auto& feature : features) {
    if (feature.estimate && feature.estimate->best && feature.estimate->best->wgs84)
      out += placemark(feature);
  }
  return out + "</Document></kml>\n";
}

}  // namespace anchord::api
