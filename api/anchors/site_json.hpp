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

}  // namespace anchord::api
