#include "api/anchors/geo_service.hpp"

#include "core/base/text.hpp"

namespace anchord::api {

Result<const Projection*> GeoService::projection(int epsg, const std::string& datum) {
  if (datum.empty())
    return make_error(Errc::invalid_argument, "the datum of the base is not stated (crs.frame of the site)");
  const auto geographic = geographic_epsg(datum);
  if (!geographic)
    return make_error(Errc::unsupported, "the datum '" + to_utf8(datum, 40) + "' is none that is known here");
  const std::scoped_lock lock(mutex_);
  const std::pair key{epsg, *geographic};
  auto found = projections_.find(key);
  if (found == projections_.end())
    found = projections_.emplace(key, Projection::open(epsg, *geographic)).first;
  if (!found->second) return found->second.error();
  return &found->second.value();
}

Result<GeoService::Projected> GeoService::projected(const std::optional<Site>& site, const Wgs84& at) {
  if (!site || !site->projected_epsg)
    return make_error(Errc::not_found, "no EPSG code is set (projected_epsg of the site)");
  BOOST_OUTCOME_TRY(const auto* map, this->projection(*site->projected_epsg, site->crs_frame));
  BOOST_OUTCOME_TRY(const auto place, map->easting_northing_m(at));
  return Projected{*site->projected_epsg, place};
}

Result<GeoService::Orthometric> GeoService::orthometric(const Wgs84& at) {
  const Geoid* geoid = nullptr;
  {
    const std::scoped_lock lock(mutex_);
    if (!geoid_) geoid_.emplace(Geoid::open(geoid_folder_));
    if (!*geoid_) return geoid_->error();
    geoid = &geoid_->value();
  }
  BOOST_OUTCOME_TRY(const double undulation_m, geoid->undulation_m(at));
  return Orthometric{at.height_m - undulation_m, geoid->name()};
}

}  // namespace anchord::api
