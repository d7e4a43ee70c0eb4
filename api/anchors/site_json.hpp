#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

/// {"lon", "lat", "h_m"}, or null.
nlohmann::ordered_json wgs84_json(const std::optional<Wgs84>& at);
nlohmann::ordered_json site_json(const Site& site);
/// Applies a merge-patch (or, for a new site, a whole body) to `site`.
void patch_site(const nlohmann::json& body, bool whole, Site& site, std::vector<FieldError>& errors);
/// Applies the FM fields of a merge-patch to `anchor`.
void patch_anchor(const nlohmann::json& body, Anchor& anchor, std::vector<FieldError>& errors);

/// Base and datum of a site, as the provenance of a calibration keeps them.
nlohmann::ordered_json site_base_json(const Site& site);
/// Puts base and datum of a site back to what such a provenance says; what it does not say stays.
void set_site_base(const nlohmann::ordered_json& base, Site& site);

}  // namespace anchord::api
