#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// EPSG code of the geographic 3D system a base station's datum is: "ETRS89" -> 4937. Capitals, blanks,
/// hyphens and an epoch in brackets do not matter. Nothing for a datum this table does not name, and for none
/// at all.
std::optional<int> geographic_epsg(std::string_view datum);

/// The epoch that is given, else the year in brackets behind the datum: "ITRF2014 (2026.3)". Nothing where
/// there is none.
std::optional<double> stated_epoch_year(std::string_view datum, const std::optional<double>& given = {});

/// Map coordinates of an EPSG code, by PROJ with what is installed (never the network, never a "ballpark"
/// that leaves out a datum shift). Safe to use from any thread.
class Projection {
 public:
  /// epsg             projected system, e.g. 25831 (ETRS89 / UTM 31N)
  /// geographic_epsg  system of the latitudes and longitudes put in, e.g. 4937
  /// epoch_year       when those were measured, e.g. 2026.9: frames such as ITRF2014 move by centimetres a
  /// year
  ///                  against a map that is fixed to its plate
  /// errors           not_found (no such code), invalid_argument (not a projected system), unsupported (no
  /// way
  ///                  from the one datum to the other with what is installed)
  static Result<Projection> open(int epsg, int geographic_epsg, std::optional<double> epoch_year = {});
  /// Of positions whose datum nobody stated: the system's own where an RTK network gives it, else ETRS89 or
  /// WGS84.
  static Result<Projection> open_own(int epsg);
  Projection(Projection&&) noexcept;
  Projection& operator=(Projection&&) noexcept;
  ~Projection();

  int epsg() const { return epsg_; }
  const std::string& name() const { return name_; }
  /// Why no easting and northing in metres comes of it (feet, axes to the south); empty: it does.
  const std::string& unusable() const;
  /// Easting and northing, whatever order the system's own axes have. errors: invalid_argument outside the
  /// projection; unsupported where the change of datum has an error above 0.5 m there, or needs an epoch that
  /// was not given. accuracy: PROJ's, below 1 mm within a zone, plus that of the change of datum where there
  /// is one.
  Result<Eigen::Vector2d> easting_northing_m(const Wgs84& at) const;
  /// The way back; height is handed through.
  Result<Wgs84> geographic(const Eigen::Vector2d& easting_northing_m, double height_m) const;

 private:
  struct Pipeline;
  Projection(int epsg, std::string name, std::unique_ptr<Pipeline> pipeline);
  int epsg_{};
  std::string name_;
  std::unique_ptr<Pipeline> pipeline_;
};

}  // namespace anchord
