#include <limits>
#include <nlohmann/json.hpp>

#include "api/anchors/geo_service.hpp"
#include "api/anchors/routes.hpp"
#include "api/anchors/site_json.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

std::string etag(const Site& site) { return "\"s-" + std::to_string(site.version) + '"'; }

Response answer(int status, const Site& site) {
  Response response = json_response(status, site_json(site));
  response.header("ETag", etag(site));
  return response;
}

Response list(AnchorApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<SiteId>(
      request,
      [&](std::size_t limit, const std::optional<SiteId>& after) { return s.sites.sites(limit, after); },
      [&](const auto& site) { return site_json(site); });
}

/// A code that no export could use is refused where it is given; whether the base's datum leads to it is not
/// asked yet, for that may be stated later.
void check_map(GeoService& geo, const Site& site, std::vector<FieldError>& errors) {
  const std::string datum = geographic_epsg(site.crs_frame) ? site.crs_frame : "WGS84";
  const auto map = geo.projection(*site.projected_epsg, datum);
  if (map && map.value()->unusable().empty()) return;
  if (!map && map.error().code == Errc::unsupported) return;
  errors.push_back({"/projected_epsg", "not_usable", map ? map.value()->unusable() : map.error().message});
}

Response create(AnchorApi& s, const Request& request) {
  std::vector<FieldError> errors;
  Site site;
  patch_site(json_body(request), true, site, errors);
  if (site.projected_epsg) check_map(s.geo, site, errors);
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
  const auto before = site.projected_epsg;
  patch_site(json_body(request), false, site, errors);
  if (site.projected_epsg && site.projected_epsg != before) check_map(s.geo, site, errors);
  refuse_if_any(errors);
  value_or_problem(s.sites.update(site, site.version));
  ++site.version;
  s.audit(request, "site.change " + to_string(site.id));
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

Ordered quota_json(const SiteQuota& quota) {
  Ordered limits = Ordered::object(), used = Ordered::object(), reached = Ordered::array();
  for (std::size_t i = 0; i < k_quota_kinds; ++i) {
    const auto kind = static_cast<QuotaKind>(i);
    const std::string word(k_quota_kind_words.word(kind));
    limits[word] = quota.limits[i] ? Ordered(*quota.limits[i]) : Ordered(nullptr);
    used[word] = quota.used[i];
    if (quota.reached(kind)) reached.push_back(word);
  }
  return {{"limits", std::move(limits)}, {"used", std::move(used)}, {"reached", std::move(reached)}};
}

/// All of them are named: a limit that was forgotten would be none.
Response limit(AnchorApi& s, const Request& request) {
  const auto site = path_id<SiteId>(request);
  const auto body = json_body(request);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  SiteLimits limits;
  std::string words;
  for (std::size_t i = 0; i < k_quota_kinds; ++i) {
    const std::string word(k_quota_kind_words.word(static_cast<QuotaKind>(i)));
    if (fields.is_object() && !body.contains(word))
      fields.error(word, "required", "must be a number, or null for no limit");
    limits[i] = fields.integer(word, 0, std::numeric_limits<std::int64_t>::max());
    words += ' ' + word + ' ' + (limits[i] ? std::to_string(*limits[i]) : "none");
  }
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
