#pragma once

#include <memory>
#include <string>

#include "core/base/result.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// Height of the geoid over the ellipsoid, from a grid file that somebody installed (GeographicLib's PGM
/// format: `geographiclib-get-geoids egm2008-5`). Without a file there is no orthometric height: it is never
/// guessed. Safe to use from any thread.
class Geoid {
 public:
  /// The finest model in `folder`, or where GeographicLib looks (GEOGRAPHICLIB_GEOID_PATH,
  /// GEOGRAPHICLIB_DATA, /usr/share/GeographicLib/geoids) when empty. errors: not_found, naming the places
  /// and the command that installs one; bad_frame for a damaged file.
  static Result<Geoid> open(const std::string& folder = {});
  Geoid(Geoid&&) noexcept;
  Geoid& operator=(Geoid&&) noexcept;
  ~Geoid();

  /// "EGM2008", "EGM96", "EGM84", or the file's name.
  const std::string& name() const { return name_; }
  /// Ellipsoidal height minus this is the height over the geoid ("sea level"). Accuracy: that of the grid,
  /// interpolated with cubics (EGM2008 5': 0.1 m worst, 5 mm typical against the full model).
  /// errors: invalid_argument (not finite, beyond the poles), storage_unavailable (the file cannot be read).
  Result<double> undulation_m(const Wgs84& at) const;

 private:
  struct Model;
  Geoid(std::string name, std::unique_ptr<Model> model);
  std::string name_;
  std::unique_ptr<Model> model_;
};

}  // namespace anchord
