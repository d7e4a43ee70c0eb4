#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/types/document.hpp"
#include "core/types/position.hpp"

namespace anchord::api {

/// Most walls of a floor; a hospital's has some 2000.
inline constexpr std::size_t k_max_walls = 10'000;

/// The worker's answer to "trace" on the globe: {outline, walls, cell_m, notes}.
nlohmann::ordered_json proposal_json(const nlohmann::json& traced, const Wgs84& origin);

/// What a person accepts: outline and walls of their own, or those of the proposal with one material.
struct AcceptedStructure {
  Document structure;        ///< {outline, walls}
  Document outline;          ///< of it, a GeoJSON polygon; empty: none
  bool site_outline{false};  ///< the outline becomes the site's
};
/// Throws the problem of a body that cannot be accepted.
AcceptedStructure read_structure(const nlohmann::json& body, const Document& proposal);

}  // namespace anchord::api
