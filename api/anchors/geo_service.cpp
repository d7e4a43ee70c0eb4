#include "api/anchors/geo_service.hpp"

#include "core/base/text.hpp"

namespace anchord::api {

// Files are opened without the lock: of two who ask at once both open, and the first stays.

const Result<Projection>& GeoService::opened(const OpenedKey& key) {
  {
    const auto known = opened_.lock();
    if (const auto at = known->projections.find(key); at != known->projections.end()) return at->second;
  }
  const auto& [epsg, geographic_epsg, epoch_year] = key;
  auto now = Projection::open(epsg, geographic_epsg, epoch_year);
  auto known = opened_.lock();
  return known->projections.try_emplace(key, std::move(now)).first->second;
}

const Result<Geoid>& GeoService::opened_geoid() {
  {
    const auto known = opened_.lock();
    const auto& geoid = known->geoid;
    if (geoid) return *geoid;
  }
  auto now = Geoid::open(geoid_folder_);
  auto known = opened_.lock();
  auto& geoid = known->geoid;
  if (!geoid) geoid.emplace(std::move(now));
  return *geoid;
}

Result<const Projection*> GeoService::projection(int epsg, const Site& site) {
  const std::string& datum = site.crs_frame;
  if (datum.empty())
    return make_error(Errc::invalid_argument, "the datum of the base is not stated (crs.frame of the site)");
  const auto geographic = geographic_epsg(datum);
  if (!geographic)
    return make_error(Errc::unsupported,
                      "the datum '" + to_utf8(datum, 40) + "' is not known to this server");
  const auto& found = opened({epsg, *geographic, stated_epoch_year(datum, site.crs_epoch)});
  if (!found) return found.error();
  return &found.value();
}

Result<GeoService::Projected> GeoService::projected(const std::optional<Site>& site, const Wgs84& at) {
  if (!site)
    return make_error(Errc::not_found, "the anchor is in no site: PATCH /anchors/{id} with its site");
  if (!site->projected_epsg)
    return make_error(Errc::not_found, "no EPSG code is set (projected_epsg of the site)");
  BOOST_OUTCOME_TRY(const auto* map, this->projection(*site->projected_epsg, *site));
  BOOST_OUTCOME_TRY(const auto place, map->easting_northing_m(at));
  return Projected{*site->projected_epsg, place};
}

Result<GeoService::Orthometric> GeoService::orthometric(const Wgs84& at) {
  const auto& geoid = opened_geoid();
  if (!geoid) return geoid.error();
  BOOST_OUTCOME_TRY(const double undulation_m, geoid.value().undulation_m(at));
  return Orthometric{at.height_m - undulation_m, geoid.value().name()};
}

}  // namespace anchord::api
