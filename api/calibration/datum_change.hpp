#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/base/enum_table.hpp"
#include "core/geo/datum.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {

/// Which way the rotations of seven parameters turn: EPSG method 1033, or 1032 with the other sign.
inline constexpr auto k_rotation_words =
    enum_table<bool>({{"position_vector", true}, {"coordinate_frame", false}});

/// A change of a site's coordinates as asked for: one of shift, mark and helmert.
struct DatumRequest {
  struct Mark {
    std::optional<NetworkId> anchor{};  ///< where the mark is now: that of a published anchor,
    std::optional<Wgs84> measured{};    ///< or given
    Wgs84 known{};                      ///< where it is in truth
  };
  std::optional<Eigen::Vector3d> shift_enu_m{};  ///< at the site
  std::optional<Mark> mark{};
  std::optional<DatumChange> helmert{};
  double sigma_m{0};  ///< of the change, per axis; joins every covariance
  std::string note;   ///< why; never empty
};
/// What is wrong is appended to `errors`.
DatumRequest read_datum_request(const nlohmann::json& body, std::vector<FieldError>& errors);

/// The published position in the changed datum, its ENU numbers about `origin`. Precondition: it is on the
/// globe.
Estimate in_datum(const PublishedPosition& before, const DatumChange& change, double sigma_m,
                  const Wgs84& origin);

}  // namespace anchord::api
