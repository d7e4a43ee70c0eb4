#include <nlohmann/json.hpp>

#include "api/anchors/geo_service.hpp"
#include "api/anchors/routes.hpp"
#include "api/anchors/site_json.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/quota_json.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/ports/organization_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

namespace {

std::string etag(const Site& site) { return "\"s-" + std::to_string(site.version) + '"'; }

Response answer(int status, const Site& site) {
  Response response = json_response(status, site_json(site));
  response.header("ETag", etag(site));
  return response;
}

Response list(AnchorApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "organization"});
  const auto organization = cursor_id<OrganizationId>(request.query_value("organization").value_or(""));
  return id_page<SiteId>(
      request,
      [&](std::size_t limit, const std::optional<SiteId>& after) {
        return s.sites.sites(limit, after, organization);
      },
      [&](const auto& site) { return site_json(site); });
}

/// A code that no export could use is refused where it is given; whether the base's datum leads to it is not
/// asked yet, for that may be stated later.
void check_map(GeoService& geo, const Site& site, std::vector<FieldError>& errors) {
  Site known = site;
  if (!geographic_epsg(site.crs_frame)) known.crs_frame = "WGS84";
  const auto map = geo.projection(*site.projected_epsg, known);
  if (map && map.value()->unusable().empty()) return;
  if (!map && map.error().code == Errc::unsupported) return;
  errors.push_back({"/projected_epsg", "not_usable", map ? map.value()->unusable() : map.error().message});
}

void check_organization(AnchorApi& s, const Site& site, std::vector<FieldError>& errors) {
  if (site.organization && !s.organizations.organization(*site.organization))
    errors.push_back({"/organization", "unknown_organization",
                      "there is no such organization; the ids are in GET /api/v1/organizations"});
}

std::string organization_words(const Site& site) {
  return site.organization ? to_string(*site.organization) : "none";
}

Response create(AnchorApi& s, const Request& request) {
  std::vector<FieldError> errors;
  Site site;
  patch_site(json_body(request), true, site, errors);
  if (site.projected_epsg) check_map(s.geo, site, errors);
  if (!site.organization) site.organization = current_sites().organization();
  check_organization(s, site, errors);
  refuse_if_any(errors);
  site.created = s.clock.now();
  site.id.uuid = make_uuid_v7(site.created);
  value_or_problem(s.sites.insert(site));
  s.audit(request, "site.create " + to_string(site.id));
  Response response = answer(201, site);
  response.header("Location", "/api/v1/sites/" + to_string(site.id));
  return response;
}

Response patch(AnchorApi& s, const Request& request) {
  Site site = value_or_problem(s.sites.site(path_id<SiteId>(request)));
  require_match(request, etag(site));
  std::vector<FieldError> errors;
  const Site before = site;
  patch_site(json_body(request), false, site, errors);
  if (site.projected_epsg && site.projected_epsg != before.projected_epsg) check_map(s.geo, site, errors);
  if (site.organization != before.organization) {
    if (!current_sites().all())
      throw_problem(403, "forbidden",
                    "only an admin token of the whole server gives a site to another organization");
    check_organization(s, site, errors);
  }
  refuse_if_any(errors);
  value_or_problem(s.sites.update(site, site.version));
  ++site.version;
  s.audit(request,
          "site.change " + to_string(site.id) +
              (site.organization == before.organization
                   ? ""
                   : " organization: " + organization_words(before) + " -> " + organization_words(site)));
  return answer(200, site);
}

Response remove(AnchorApi& s, const Request& request) {
  const Site site = value_or_problem(s.sites.site(path_id<SiteId>(request)));
  require_match(request, etag(site));
  value_or_problem(s.sites.remove(site.id, site.version));
  s.audit(request, "site.delete " + to_string(site.id));
  Response response;
  response.status = 204;
  return response;
}

Response limit(AnchorApi& s, const Request& request) {
  const auto site = path_id<SiteId>(request);
  const auto body = json_body(request);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  std::string words;
  const SiteLimits limits = quota_limits<k_quota_kinds>(fields, words);
  fields.finish();
  refuse_if_any(errors);
  value_or_problem(s.sites.set_limits(site, limits));
  s.audit(request, "site.quota " + to_string(site) + words);
  return json_response(200, quota_json(value_or_problem(s.sites.quota(site))));
}

}  // namespace

void add_site_routes(Router& router, AnchorApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto admin = Access::any_of({Role::admin});
  router.add({Method::get, "/api/v1/sites", readers(), on(list)});
  router.add({Method::post, "/api/v1/sites", admin, on(create)});
  router.add({Method::get, "/api/v1/sites/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return answer(200, value_or_problem(s.sites.site(path_id<SiteId>(request))));
              }});
  router.add({Method::get, "/api/v1/sites/{id}/quota", readers(), [&s](const Request& request) {
                check_query(request, {});
                return json_response(200,
                                     quota_json(value_or_problem(s.sites.quota(path_id<SiteId>(request)))));
              }});
  router.add({Method::put, "/api/v1/sites/{id}/quota", admin, on(limit)});
  router.add({Method::patch, "/api/v1/sites/{id}", admin, on(patch), 1 << 20, false, true});
  router.add({Method::del, "/api/v1/sites/{id}", admin, on(remove), 1 << 20, false, true});
}

}  // namespace anchord::api
