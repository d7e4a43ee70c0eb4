#pragma once

#include <optional>

#include "api/kit/message.hpp"
#include "core/base/ids.hpp"

namespace anchord {
class SiteStore;
}

namespace anchord::api {

/// The site that `?site=` names. One that is none is refused (422 of what is no id, 404 of a site that there
/// is not, or that the caller does not see): whoever mirrors what is answered would take nothing for all that
/// is left.
std::optional<SiteId> query_site(SiteStore& sites, const Request& request);

}  // namespace anchord::api
