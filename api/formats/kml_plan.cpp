#include "api/formats/kml_plan.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <pugixml.hpp>

#include "api/formats/area_kind.hpp"
#include "api/formats/geojson_plan.hpp"
#include "api/formats/qgc_plan.hpp"
#include "api/formats/xml_document.hpp"
#include "api/kit/reader.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_max_corners = 2000, k_max_waypoints = 1000;

/// The names of the fields are not asked: those we look for tell themselves by their values.
std::string data_of(const pugi::xml_node& placemark) {
  std::string out;
  for (const auto& data : child_of(placemark, "ExtendedData")) {
    out += ' ' + child_text(data, "value");
    for (const auto& simple : data)
      if (local_name(simple) == "SimpleData") out += ' ' + text_of(simple);
  }
  return out;
}

/// What a field called kind says.
std::string kind_field(const pugi::xml_node& placemark) {
  const auto is_kind = [](const pugi::xml_node& node) {
    const std::string_view name = node.attribute("name").value();
    return name == "kind" || name == "Kind" || name == "KIND";
  };
  for (const auto& data : child_of(placemark, "ExtendedData")) {
    if (is_kind(data)) return child_text(data, "value");
    for (const auto& simple : data)
      if (is_kind(simple)) return text_of(simple);
  }
  return {};
}

struct Place {
  LonLat at;
  std::optional<double> height_m{};
};

std::optional<double> number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

class KmlReader {
 public:
  KmlReader(std::vector<std::string>& notes, std::vector<FieldError>& errors)
      : notes_(notes), errors_(errors) {}

  Plan plan;

  void walk(const pugi::xml_node& node, std::optional<AreaKind> kind) {
    const auto name = local_name(node);
    if (name == "Folder") {
      if (const auto said = area_kind_in(child_text(node, "name"))) kind = said;
    }
    if (name == "Placemark") return placemark(node, kind);
    if (name == "NetworkLink" || name == "GroundOverlay" || name == "PhotoOverlay" ||
        name == "ScreenOverlay") {
      return note(std::string(name) + " was left out: only what the file itself contains is read");
    }
    for (const auto& child : node) walk(child, kind);
  }

  std::size_t n_placemarks() const { return n_; }

 private:
  void note(std::string text) {
    if (notes_.size() < 100) notes_.push_back(std::move(text));
  }
  void fail(const char* code, std::string detail) {
    const std::string name = name_.empty() ? "" : " (" + name_ + ")";
    if (errors_.size() < 100) errors_.push_back({at_, code, std::move(detail) + name});
  }

  void placemark(const pugi::xml_node& node, std::optional<AreaKind> folder) {
    at_ = "/Placemark/" + std::to_string(n_++);
    name_ = to_utf8(child_text(node, "name"), 60);
    const auto given = kind_field(node);
    auto kind = area_kind_in(data_of(node));
    if (!kind && !given.empty() && !(kind = area_kind(given)))
      return fail("unknown_value",
                  "kind must be " + std::string(k_area_kinds) + ", not " + to_utf8(given, 60));
    if (!kind) kind = area_kind_in(child_text(node, "name"));
    if (!kind) kind = folder;
    bool any = false;
    for (const auto& child : node) any = geometry(child, kind) || any;
    if (!any && bounds_flight(kind)) return fail("required", "a fence or no-fly area without a polygon");
    if (!any) note(at_ + " has no point, line or polygon and was left out");
  }

  bool geometry(const pugi::xml_node& node, std::optional<AreaKind> kind) {
    const auto name = local_name(node);
    if (name == "MultiGeometry") {
      for (const auto& child : node) geometry(child, kind);
    } else if (name == "Polygon") {
      polygon(node, kind);
    } else if (bounds_flight(kind) &&
               (name == "LineString" || name == "LinearRing" || name == "Track" || name == "MultiTrack")) {
      fail("wrong_type",
           "a " + std::string(name) + " bounds no area: draw the fence or no-fly area as a polygon");
    } else if (name == "Point" || name == "LineString") {
      waypoints(node, kind);
    } else if (name == "LinearRing" || name == "Model" || name == "Track" || name == "MultiTrack") {
      note(at_ + " has a " + std::string(name) + ", which was left out");
    } else {
      return false;
    }
    return true;
  }

  /// Triples of lon,lat[,height] with white space between them.
  std::optional<std::vector<Place>> places(const pugi::xml_node& node) {
    std::vector<Place> out;
    const std::string coordinates = child_text(node, "coordinates");
    std::string_view text = coordinates;
    const auto wrong = [&](const char* code, std::string detail) {
      fail(code, std::move(detail));
      return std::nullopt;
    };
    if (text.empty()) return wrong("required", std::string(local_name(node)) + " has no coordinates");
    while (!text.empty()) {
      const auto space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
      const auto begin =
          static_cast<std::size_t>(std::find_if_not(text.begin(), text.end(), space) - text.begin());
      text.remove_prefix(begin);
      if (text.empty()) break;
      const auto length =
          static_cast<std::size_t>(std::find_if(text.begin(), text.end(), space) - text.begin());
      const auto one = text.substr(0, length);
      text.remove_prefix(length);
      std::vector<std::optional<double>> parts;
      for (std::size_t from = 0; from <= one.size();) {
        const auto comma = std::min(one.find(',', from), one.size());
        parts.push_back(number(one.substr(from, comma - from)));
        from = comma + 1;
      }
      const bool good =
          (parts.size() == 2 || parts.size() == 3) &&
          std::all_of(parts.begin(), parts.end(), [](const auto& p) { return p.has_value(); }) &&
          std::abs(*parts[0]) <= 180 && std::abs(*parts[1]) <= 90;
      if (!good) {
        return wrong(
            "out_of_range",
            "coordinates must be lon,lat or lon,lat,height in degrees and metres, not " + to_utf8(one, 60));
      }
      out.push_back({{*parts[0], *parts[1]}, parts.size() == 3 ? parts[2] : std::nullopt});
      if (out.size() > k_max_corners)
        return wrong("out_of_range", "more than " + std::to_string(k_max_corners) + " corners");
    }
    return out;
  }

  void polygon(const pugi::xml_node& node, std::optional<AreaKind> kind) {
    const auto ring = child_of(child_of(node, "outerBoundaryIs"), "LinearRing");
    if (!ring) return fail("required", "a Polygon needs outerBoundaryIs with a LinearRing");
    if (child_of(node, "innerBoundaryIs")) {
      if (kind == AreaKind::fence)
        return fail("conflict", "a fence with holes: draw each hole as a no-fly area of its own");
      note(at_ + (kind == AreaKind::no_fly ? " has holes: the whole of the no-fly area is kept out of"
                                           : " has courtyards, which are not flown into"));
    }
    const auto corners = places(ring);
    if (!corners) return;
    GeoPolygon area;
    for (const auto& corner : *corners) {
      if (area.empty() || !(corner.at == area.back())) area.push_back(corner.at);
    }
    if (area.size() > 1 && area.front() == area.back()) area.pop_back();
    if (area.size() < 3) return fail("out_of_range", "a polygon needs 3 different corners");
    if (kind == AreaKind::no_fly) {
      plan.no_fly.push_back(std::move(area));
    } else if (kind == AreaKind::fence) {
      if (!plan.fence.empty()) return fail("conflict", "a second fence: a plan can have only one");
      plan.fence = std::move(area);
    } else if (plan.outline.empty()) {
      plan.outline = std::move(area);
      // Drawn at the height of the roof, it tells that too.
      const auto& roof = corners->front().height_m;
      if (child_text(node, "altitudeMode") == "relativeToGround" && roof && *roof >= 1 && *roof <= 500)
        plan.building_height_m = *roof;
    } else {
      fail("conflict",
           "a second building outline: mark other areas as no-fly or fence by their name, their folder or a "
           "data field kind");
    }
  }

  void waypoints(const pugi::xml_node& node, std::optional<AreaKind> kind) {
    const auto all = places(node);
    if (!all) return;
    const auto mode = child_text(node, "altitudeMode");
    for (const auto& place : *all) {
      if (mode != "relativeToGround" || !place.height_m) {
        return fail(
            "required",
            mode == "absolute"
                ? "heights above sea level cannot be used without the ground height: use relativeToGround"
                : "a waypoint needs altitudeMode relativeToGround and a height as third coordinate");
      }
      if (!(*place.height_m >= 0 && *place.height_m <= 500))
        return fail("out_of_range", "the height above ground must be 0 to 500 m");
      if (plan.waypoints.size() >= k_max_waypoints)
        return fail("out_of_range", "more than " + std::to_string(k_max_waypoints) + " waypoints");
      PlanWaypoint w;
      w.at = place.at;
      w.height_m = *place.height_m;
      w.measure = kind != AreaKind::transit;
      plan.waypoints.push_back(w);
    }
  }

  std::vector<std::string>& notes_;
  std::vector<FieldError>& errors_;
  std::string at_, name_;
  std::size_t n_{0};
};

}  // namespace

Plan read_kml_plan(std::string_view text, std::vector<std::string>& notes, std::vector<FieldError>& errors) {
  pugi::xml_document document;
  if (const auto read = read_xml(text, document); !read) {
    errors.push_back({"", "malformed", read.error().message});
    return {};
  }
  const auto root = document.document_element();
  if (local_name(root) != "kml") {
    errors.push_back({"", "unknown_value", "the document is " + to_utf8(local_name(root), 40) + ", not kml"});
    return {};
  }
  KmlReader reader(notes, errors);
  reader.walk(root, {});
  if (reader.n_placemarks() == 0 && errors.empty())
    errors.push_back({"", "required", "the file has no Placemark: it contains no drawing"});
  return std::move(reader.plan);
}

Plan read_plan_file(std::string_view text, std::vector<std::string>& notes, std::vector<FieldError>& errors) {
  if (text.starts_with("PK")) {
    errors.push_back(
        {"", "unknown_value", "this is a KMZ archive: unpack it and send the file doc.kml in it"});
    return {};
  }
  const auto first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first != std::string_view::npos && text[first] == '<') return read_kml_plan(text, notes, errors);
  nlohmann::json body;
  if (auto wrong = parse_json(text, body)) {
    errors.push_back(std::move(*wrong));
    return {};
  }
  const bool qgc = body.is_object() && body.value("fileType", nlohmann::json()) == "Plan";
  return qgc ? read_qgc_plan(body, notes, errors) : read_geojson_plan(body, notes, errors);
}

}  // namespace anchord::api
