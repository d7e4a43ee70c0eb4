#include "api/kit/query_site.hpp"

#include "api/kit/current_sites.hpp"
#include "api/kit/support.hpp"
#include "core/base/text.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

std::optional<SiteId> query_site(SiteStore& sites, const Request& request) {
  const auto text = request.query_value("site");
  if (!text) return std::nullopt;
  const auto uuid = parse_uuid(*text);
  if (!uuid)
    throw_problem(422, "validation", "site must be the id of a site",
                  {{"/site", "bad_id", "must be an id as in GET /api/v1/sites, not a name"}});
  const SiteId site{uuid.value()};
  if (!current_sites().holds(site) || !sites.site(site))
    throw_problem(404, "not-found", "there is no site " + to_string(site));
  return site;
}

}  // namespace anchord::api
