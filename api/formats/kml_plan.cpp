#include "api/formats/kml_plan.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "api/formats/qgc_plan.hpp"
#include "api/formats/xml_tree.hpp"
#include "api/kit/reader.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_max_corners = 2000, k_max_waypoints = 1000;

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

enum class Kind : std::uint8_t { unsaid, outline, no_fly, fence, transit };

Kind kind_of(std::string_view text) {
  const std::string word = lower(text);
  const auto has = [&](const char* part) { return word.find(part) != std::string::npos; };
  if (has("no_fly") || has("no-fly") || has("no fly") || has("nofly")) return Kind::no_fly;
  if (has("fence")) return Kind::fence;
  if (has("outline") || has("building")) return Kind::outline;
  if (has("transit")) return Kind::transit;
  return Kind::unsaid;
}

/// `Data name="kind"` loses its attribute in our tree: the fields we ask for tell themselves by their values.
std::string data_of(const XmlNode& placemark) {
  std::string out;
  const auto* extended = placemark.child("ExtendedData");
  if (extended == nullptr) return out;
  for (const auto& data : extended->children) {
    out += ' ';
    out += data.child_text("value");
    for (const auto& simple : data.children) {
      if (simple.name == "SimpleData") out += ' ' + simple.text;
    }
  }
  return out;
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

class Reader {
 public:
  Reader(std::vector<std::string>& notes, std::vector<FieldError>& errors) : notes_(notes), errors_(errors) {}

  Plan plan;

  void walk(const XmlNode& node, Kind kind) {
    if (node.name == "Folder" || node.name == "Document") {
      if (const Kind said = kind_of(node.child_text("name")); said != Kind::unsaid && node.name == "Folder")
        kind = said;
    }
    if (node.name == "Placemark") return placemark(node, kind);
    if (node.name == "NetworkLink" || node.name == "GroundOverlay" || node.name == "PhotoOverlay" ||
        node.name == "ScreenOverlay") {
      return note(node.name + " was left out: only what the file itself contains is read");
    }
    for (const auto& child : node.children) walk(child, kind);
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

  void placemark(const XmlNode& node, Kind folder) {
    at_ = "/Placemark/" + std::to_string(n_++);
    name_ = to_utf8(node.child_text("name"), 60);
    Kind kind = kind_of(data_of(node));
    if (kind == Kind::unsaid) kind = kind_of(node.child_text("name"));
    if (kind == Kind::unsaid) kind = folder;
    bool any = false;
    for (const auto& child : node.children) any = geometry(child, kind) || any;
    if (!any) note(at_ + " has no point, line or polygon and was left out");
  }

  bool geometry(const XmlNode& node, Kind kind) {
    if (node.name == "MultiGeometry") {
      for (const auto& child : node.children) geometry(child, kind);
      return true;
    }
    if (node.name == "Polygon") return polygon(node, kind), true;
    if (node.name == "Point" || node.name == "LineString") return waypoints(node, kind), true;
    if (node.name == "LinearRing" || node.name == "Model" || node.name == "Track" ||
        node.name == "MultiTrack")
      return note(at_ + " has a " + node.name + ", which was left out"), true;
    return false;
  }

  /// Triples of lon,lat[,height] with white space between them.
  std::optional<std::vector<Place>> places(const XmlNode& node) {
    std::vector<Place> out;
    std::string_view text = node.child_text("coordinates");
    if (text.empty()) return fail("required", node.name + " has no coordinates"), std::nullopt;
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
        return fail("out_of_range",
                    "coordinates must be lon,lat or lon,lat,height in degrees and metres, not " +
                        to_utf8(one, 60)),
               std::nullopt;
      }
      out.push_back({{*parts[0], *parts[1]}, parts.size() == 3 ? parts[2] : std::nullopt});
      if (out.size() > k_max_corners)
        return fail("out_of_range", "more than " + std::to_string(k_max_corners) + " corners"), std::nullopt;
    }
    return out;
  }

  void polygon(const XmlNode& node, Kind kind) {
    const auto* outer = node.child("outerBoundaryIs");
    const auto* ring = outer != nullptr ? outer->child("LinearRing") : nullptr;
    if (ring == nullptr) return fail("required", "a Polygon needs outerBoundaryIs with a LinearRing");
    if (node.child("innerBoundaryIs") != nullptr) note(at_ + " has holes, which were left out");
    const auto corners = places(*ring);
    if (!corners) return;
    GeoPolygon area;
    for (const auto& corner : *corners) {
      if (area.empty() || !(corner.at == area.back())) area.push_back(corner.at);
    }
    if (area.size() > 1 && area.front() == area.back()) area.pop_back();
    if (area.size() < 3) return fail("out_of_range", "a polygon needs 3 different corners");
    if (kind == Kind::no_fly) {
      plan.no_fly.push_back(std::move(area));
    } else if (kind == Kind::fence) {
      if (!plan.fence.empty()) return fail("conflict", "a second fence: a plan has one");
      plan.fence = std::move(area);
    } else if (plan.outline.empty()) {
      plan.outline = std::move(area);
      // Drawn at the height of the roof, it tells that too.
      const auto& roof = corners->front().height_m;
      if (node.child_text("altitudeMode") == "relativeToGround" && roof && *roof >= 1 && *roof <= 500)
        plan.building_height_m = *roof;
    } else {
      fail("conflict",
           "a second building outline: call other areas no-fly or fence, by their name, their folder or a "
           "data "
           "field kind");
    }
  }

  void waypoints(const XmlNode& node, Kind kind) {
    const auto all = places(node);
    if (!all) return;
    const auto mode = node.child_text("altitudeMode");
    for (const auto& place : *all) {
      if (mode != "relativeToGround" || !place.height_m) {
        return fail("required",
                    mode == "absolute"
                        ? "heights above sea level say nothing without the ground: use relativeToGround"
                        : "a waypoint needs altitudeMode relativeToGround and a height as third coordinate");
      }
      if (!(*place.height_m >= 0 && *place.height_m <= 500))
        return fail("out_of_range", "the height above ground must be 0 to 500 m");
      if (plan.waypoints.size() >= k_max_waypoints)
        return fail("out_of_range", "more than " + std::to_string(k_max_waypoints) + " waypoints");
      PlanWaypoint w;
      w.at = place.at;
      w.height_m = *place.height_m;
      w.measure = kind != Kind::transit;
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
  const auto root = parse_xml(text);
  if (!root) {
    errors.push_back({"", "malformed", root.error().message});
    return {};
  }
  if (root.value().name != "kml") {
    errors.push_back(
        {"", "unknown_value", "the document is " + to_utf8(root.value().name, 40) + ", not kml"});
    return {};
  }
  Reader reader(notes, errors);
  reader.walk(root.value(), Kind::unsaid);
  if (reader.n_placemarks() == 0 && errors.empty())
    errors.push_back({"", "required", "the file has no Placemark: nothing is drawn in it"});
  return std::move(reader.plan);
}

Plan read_plan_file(std::string_view text, std::vector<std::string>& notes, std::vector<FieldError>& errors) {
  if (text.starts_with("PK")) {
    errors.push_back({"", "unknown_value", "this is a KMZ archive: unpack it and send the doc.kml inside"});
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
  return qgc ? read_qgc_plan(body, notes, errors) : read_geojson_plan(body, errors);
}

}  // namespace anchord::api
