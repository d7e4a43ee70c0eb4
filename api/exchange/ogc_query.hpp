#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"
#include "core/base/time.hpp"
#include "core/types/lon_lat_box.hpp"

namespace anchord::api {

/// Coordinate reference systems of the OGC face: the same ellipsoidal coordinates, in the order of axes and
/// with the number of dimensions that each of them has.
struct OgcCrs {
  std::string_view uri;
  bool latitude_first;
  bool has_height;
};
/// Longitude, latitude, ellipsoidal height: what is stored, and what is answered where none is named.
inline constexpr OgcCrs k_storage_crs{"http://www.opengis.net/def/crs/OGC/0/CRS84h", false, true};
inline constexpr std::array k_ogc_crs{k_storage_crs,
                                      OgcCrs{"http://www.opengis.net/def/crs/OGC/1.3/CRS84", false, false},
                                      OgcCrs{"http://www.opengis.net/def/crs/EPSG/0/4979", true, true},
                                      OgcCrs{"http://www.opengis.net/def/crs/EPSG/0/4326", true, false}};

/// Of features without heights.
inline constexpr OgcCrs k_flat_crs = k_ogc_crs[1];

/// A bounding box with heights, metres.
struct OgcBox : LonLatBox {
  double low_m, high_m;
  bool holds(const Wgs84& at) const {
    return LonLatBox::holds(at) && at.height_m >= low_m && at.height_m <= high_m;
  }
};

/// Instants from..to, both included; an open end is absent.
struct OgcInterval {
  std::optional<UtcTime> from, to;
  bool meets(UtcTime begin, UtcTime end) const { return (!to || begin <= *to) && (!from || end >= *from); }
};

/// What a request for items asks. Faults are 400, as OGC 17-069r4 wants them (requirements 7 and 8).
struct OgcQuery {
  std::size_t limit;
  std::string cursor;
  std::optional<OgcBox> box;
  std::optional<OgcInterval> interval;
  OgcCrs crs;
  bool filters() const { return box || interval; }
};
/// `limit` above the maximum means the maximum. heights: whether the features have them
OgcQuery ogc_items_query(const Request& request, std::size_t usual, std::size_t maximum, bool heights);
/// `crs` of a request for one item.
OgcCrs ogc_item_query(const Request& request, bool heights);
/// For documents, which only take `f=json`.
void ogc_document_query(const Request& request);

/// Turns GeoJSON coordinates of any nesting from longitude, latitude, height to the system's own.
void reorder(nlohmann::ordered_json& coordinates, const OgcCrs& crs);

}  // namespace anchord::api
