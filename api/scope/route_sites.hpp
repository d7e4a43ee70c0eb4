#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "api/kit/message.hpp"
#include "core/base/enum_table.hpp"

namespace anchord {
class MissionBin;
}

namespace anchord::api {

class MissionService;
class Router;
struct Route;

/// What a token that is bound to sites may do at a route.
enum class SiteRule : std::uint8_t {
  open,     ///< it says nothing of any site
  stored,   ///< what it names and lists is read and written through ScopedStores, which holds it to the sites
  mission,  ///< {id} is a mission, which must be of the sites; what else it names is stored
  asked,    ///< ?mission= must be there; it is stored
  own,      ///< who is bound to an organization makes and removes sites of it; of sites that are named, 403
  own_job,  ///< a job that a token of these sites submitted
  refused,  ///< it is of the whole server: 403
};

struct RouteSites {
  Method method;
  std::string_view pattern;
  SiteRule rule;
};
/// One row a route. A route without a row is refused.
std::span<const RouteSites> route_sites();
SiteRule site_rule(Method method, std::string_view pattern);

}  // namespace anchord::api
