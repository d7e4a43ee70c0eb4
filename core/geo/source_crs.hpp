#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/types/position.hpp"

struct PJconsts;  // PJ of PROJ

namespace anchord {

/// In which system the positions of somebody else's track are, and above what their heights.
struct SourceCrsSpec {
  /// "EPSG:25832" or "25832" (projected, geographic or geocentric), "UTM 32N" (WGS84), "ECEF" (WGS84).
  std::string crs;
  /// Of a vertical system, such as 5773 (EGM96 height); absent: above the ellipsoid, or `separation_m`.
  std::optional<int> height_epsg{};
  /// Height of the geoid above the ellipsoid, added to every height.
  std::optional<double> separation_m{};
  /// Largest error of a change of datum that is accepted.
  double max_datum_error_m{0.5};
};

/// "ellipsoidal", "EPSG:5773", or metres of geoid separation ("47.3") into `spec`.
/// errors: invalid_argument, naming what is expected
Result<void> read_heights(std::string_view text, SourceCrsSpec& spec);

/// Positions of one coordinate system to longitude, latitude and ellipsoidal height, by PROJ with what is
/// installed: one operation for a whole track, never a ballpark. Safe to use from any thread.
class SourceCrs {
 public:
  /// first   a position of the track: it decides which operation fits, and must be within the system's area
  /// errors  not_found (no such code), invalid_argument (not understood; place outside the system's area),
  ///         unsupported (no way with the grids installed, or only one worse than max_datum_error_m)
  static Result<SourceCrs> open(const SourceCrsSpec& spec, const Eigen::Vector3d& first);
  SourceCrs(SourceCrs&&) noexcept;
  SourceCrs& operator=(SourceCrs&&) noexcept;
  ~SourceCrs();

  /// "ETRS89 / UTM zone 32N"
  const std::string& name() const { return name_; }
  /// Of the latitudes and longitudes that come out: "ETRS89", "WGS 84", ...
  const std::string& datum() const { return datum_; }
  /// "above the ellipsoid", or how they were made so.
  const std::string& heights() const { return heights_; }
  /// What PROJ says of the change of datum, one number for all; 0 where there is none.
  double datum_error_m() const { return datum_error_m_; }

  /// X, Y, Z of the earth's centre, not a map.
  bool geocentric() const { return geocentric_; }

  /// at      easting, northing, height; longitude, latitude (degrees), height; or X, Y, Z of ECEF: metres
  /// errors  invalid_argument (outside the system, or not finite)
  Result<Wgs84> wgs84(const Eigen::Vector3d& at) const;
  /// Bearing of the system's second axis (grid north) from true north, clockwise, in radians; 0 for degrees
  /// and ECEF. What is an angle in a map is by this much less in ENU, counter-clockwise.
  double convergence_rad(const Eigen::Vector3d& at) const;

 private:
  struct Operations;
  SourceCrs();
  Result<void> prepare(const SourceCrsSpec& spec, const Eigen::Vector3d& first);
  Result<void> find_horizontal(Operations& of, PJconsts* crs, const SourceCrsSpec& spec,
                               const Eigen::Vector3d& first);
  Result<void> find_vertical(Operations& of, const SourceCrsSpec& spec, const Eigen::Vector3d& first);
  Result<Wgs84> converted(Operations& operations, const Eigen::Vector3d& at) const;
  std::string name_, datum_, heights_;
  double datum_error_m_{0};
  bool projected_{false}, geocentric_{false};
  std::optional<double> separation_m_;
  std::unique_ptr<Locked<Operations>> operations_;  ///< a PJ belongs to one thread at a time
};

}  // namespace anchord
