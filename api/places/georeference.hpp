#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "core/base/result.hpp"
#include "core/floor_plan/georeference.hpp"
#include "core/floor_plan/image_head.hpp"
#include "core/geo/projection.hpp"
#include "core/types/document.hpp"
#include "core/types/position.hpp"

namespace anchord::api {

/// Where a plan lies, and how that is known.
struct Georeference {
  Wgs84 origin{};  ///< of the ENU metres
  floor_plan::PlanTransform transform{};
  Document document;                   ///< as it is kept and shown
  std::optional<std::string> wrong{};  ///< why it must not be taken: a point that does not fit the others
};

/// What a site states of its latitudes and longitudes.
struct SiteDatum {
  std::string frame;                   ///< "ETRS89"; empty: not stated
  std::optional<double> epoch_year{};  ///< 2026.9
};

/// The map system of an EPSG code, for a site of this datum. A site that names none has that of its base; a
/// map is then taken to be in the same one, for from ETRS89 to WGS 84 there is no exact way, and RTK networks
/// give the datum of their country's maps. errors  as of Projection::open
Result<Projection> map_of(int epsg, const SiteDatum& datum);

/// By the tags of a GeoTIFF, or a map file beside the picture: the map's affine in metres round the origin.
/// datum  of the site, for a map of another one
/// errors unsupported (a map without a code, or whose code is not known here), invalid_argument
Result<Georeference> by_map(const floor_plan::GeoTags& tags, std::string_view source, std::int64_t width_px,
                            std::int64_t height_px, const std::optional<Wgs84>& site_origin,
                            const SiteDatum& datum);

/// By the body of PUT .../georeference. Throws its problem.
/// tags  of the plan, for source "geotiff"
Georeference read_georeference(const nlohmann::json& body, const std::optional<floor_plan::GeoTags>& tags,
                               std::int64_t width_px, std::int64_t height_px,
                               const std::optional<Wgs84>& site_origin, const SiteDatum& datum);

/// Of what is kept; nothing where a plan was never placed.
std::optional<Georeference> kept_georeference(const Document& document);

}  // namespace anchord::api
