#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "api/exchange/ogc_query.hpp"

namespace anchord::api {

inline constexpr std::string_view k_geojson = "application/geo+json";

/// One collection of the OGC face. The limits keep a page at some megabytes: a flight is thousands of times
/// an anchor.
struct OgcCollection {
  std::string_view id, title, description;
  std::size_t usual_limit, max_limit;
  bool has_heights{true};
};
inline constexpr std::array k_ogc_collections{
    OgcCollection{"anchors", "UWB anchors", "Anchors of the newest published revision", 100, 1000},
    OgcCollection{
        "revisions", "Published positions",
        "Every position that was ever published: one feature for each revision that set an anchor's "
        "position",
        100, 1000},
    OgcCollection{"tracks", "Flight paths",
                  "One line for each flight, newest first, at least spacing_m between its vertices", 10, 50},
    OgcCollection{"zones", "Floors", "Floors of buildings, with the outline that a person accepted", 100,
                  1000, false}};
/// Null where there is none of this name.
const OgcCollection* ogc_collection(std::string_view id);

/// Where a collection's features are.
struct OgcExtent {
  std::optional<OgcBox> box;
  std::optional<OgcInterval> interval;
};

/// `root` is the absolute address of /ogc, as the client wrote it.
nlohmann::ordered_json ogc_landing(const std::string& root);
nlohmann::ordered_json ogc_conformance();
nlohmann::ordered_json ogc_collection_json(const std::string& root, const OgcCollection& collection,
                                           const OgcExtent& extent);
/// OpenAPI 3.0, since the clients of this face read no 3.1.
nlohmann::ordered_json ogc_openapi(const std::string& root);

nlohmann::ordered_json ogc_link(std::string href, std::string_view rel, std::string_view type,
                                std::string_view title);

}  // namespace anchord::api
