#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "core/base/locked.hpp"
#include "core/geo/geoid.hpp"
#include "core/geo/projection.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

/// What a position is called in other systems, or why it is not: map coordinates of the site's EPSG code, and
/// the height over the geoid. Opens each projection once and the geoid file at the first question.
/// Thread-safe.
class GeoService {
 public:
  /// geoid_folder: empty for where GeographicLib looks.
  explicit GeoService(std::string geoid_folder = {}) : geoid_folder_(std::move(geoid_folder)) {}

  struct Projected {
    int epsg{};
    Eigen::Vector2d easting_northing_m{0, 0};
  };
  /// Errors say what is missing: no EPSG code, a base whose datum is not stated (a shift of up to a metre
  /// would be guessed), a place outside the map.
  Result<Projected> projected(const std::optional<Site>& site, const Wgs84& at);
  /// Of positions in the frame and at the epoch that the site states.
  Result<const Projection*> projection(int epsg, const Site& site);

  struct Orthometric {
    double height_m{};
    std::string geoid;
  };
  Result<Orthometric> orthometric(const Wgs84& at);

 private:
  /// EPSG codes of the map and of the geographic system, and the epoch.
  using OpenedKey = std::tuple<int, int, std::optional<double>>;
  /// Only ever added to, so that what was found stays where it is; both are thread-safe themselves.
  struct Opened {
    std::map<OpenedKey, Result<Projection>> projections;
    std::optional<Result<Geoid>> geoid;
  };
  const Result<Projection>& opened(const OpenedKey& key);
  const Result<Geoid>& opened_geoid();

  const std::string geoid_folder_;
  Locked<Opened> opened_;
};

}  // namespace anchord::api
