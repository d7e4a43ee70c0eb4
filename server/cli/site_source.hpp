#pragma once

#include <string>

#include "core/base/result.hpp"
#include "server/cli/rest_client.hpp"
#include "server/flight/site_world.hpp"

namespace anchord::cli {

/// The world of a site of a running server (site_scene), asked for over REST: site, buildings, floors with
/// their accepted walls, published anchors.
/// errors  those of the client; invalid_argument: the site has no origin, or an answer is of another shape
Result<flight::Scene> fetch_site_scene(RestClient& client, const std::string& site);

}  // namespace anchord::cli
