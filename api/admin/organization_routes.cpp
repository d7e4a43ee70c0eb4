#include <nlohmann/json.hpp>

#include "api/admin/access.hpp"
#include "api/admin/routes.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/quota_json.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/base/time.hpp"
#include "core/ports/organization_store.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

constexpr std::string_view k_requests_per_minute = "requests_per_minute";
constexpr std::size_t k_max_organization_name = 200, k_max_description = 2000;

std::string etag(const Organization& organization) {
  return "\"o-" + std::to_string(organization.version) + '"';
}

Ordered organization_json(const Organization& organization) {
  return {{"id", to_string(organization.id)},
          {"name", organization.name},
          {"description",
           organization.description.empty() ? Ordered(nullptr) : Ordered(organization.description)},
          {"created_at", to_rfc3339(organization.created)}};
}

Response answer(int status, const Organization& organization) {
  Response response = json_response(status, organization_json(organization));
  response.header("ETag", etag(organization));
  return response;
}

/// A merge-patch, or the whole of a new one.
void patch_organization(const Json& body, bool whole, Organization& organization) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  if (auto name = fields.text("name", k_max_organization_name, whole)) {
    if (name->empty()) fields.error("name", "required", "must not be empty");
    organization.name = *std::move(name);
  }
  if (auto text = fields.text("description", k_max_description))
    organization.description = *std::move(text);
  else if (fields.is_object() && body.contains("description"))
    organization.description.clear();
  fields.finish();
  refuse_if_any(errors);
}

Response list(OrganizationApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<OrganizationId>(
      request,
      [&](std::size_t limit, const std::optional<OrganizationId>& after) {
        return s.organizations.organizations(limit, after);
      },
      [](const auto& organization) { return organization_json(organization); });
}

Response create(OrganizationApi& s, const Request& request) {
  Organization organization;
  patch_organization(json_body(request), true, organization);
  organization.created = s.clock.now();
  organization.id.uuid = make_uuid_v7(organization.created);
  value_or_problem(s.organizations.insert(organization));
  s.audit(request, "organization.create " + to_string(organization.id));
  Response response = answer(201, organization);
  response.header("Location", "/api/v1/organizations/" + to_string(organization.id));
  return response;
}

Response patch(OrganizationApi& s, const Request& request) {
  auto organization = value_or_problem(s.organizations.organization(path_id<OrganizationId>(request)));
  require_match(request, etag(organization));
  patch_organization(json_body(request), false, organization);
  value_or_problem(s.organizations.update(organization, organization.version));
  ++organization.version;
  s.audit(request, "organization.change " + to_string(organization.id));
  return answer(200, organization);
}

Response remove(OrganizationApi& s, const Request& request) {
  const auto organization = value_or_problem(s.organizations.organization(path_id<OrganizationId>(request)));
  require_match(request, etag(organization));
  value_or_problem(s.organizations.remove(organization.id, organization.version));
  s.audit(request, "organization.delete " + to_string(organization.id));
  Response response;
  response.status = 204;
  return response;
}

Response quota(OrganizationApi& s, const OrganizationId& id) {
  auto out = quota_json(value_or_problem(s.organizations.quota(id)));
  const auto limits = value_or_problem(s.organizations.limits(id));
  out["limits"]["requests_per_minute"] =
      limits.requests_per_minute ? Ordered(*limits.requests_per_minute) : Ordered(nullptr);
  return json_response(200, out);
}

Response limit(OrganizationApi& s, const Request& request) {
  const auto id = path_id<OrganizationId>(request);
  const auto body = json_body(request);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  std::string words;
  OrganizationLimits limits;
  limits.stored = quota_limits<k_organization_quota_kinds>(fields, words);
  fields.must_be_named(k_requests_per_minute);
  if (const auto most = fields.integer(k_requests_per_minute, 1, k_most_requests_per_minute))
    limits.requests_per_minute = static_cast<std::uint32_t>(*most);
  fields.finish();
  refuse_if_any(errors);
  value_or_problem(s.organizations.set_limits(id, limits));
  words += " requests_per_minute " +
           (limits.requests_per_minute ? std::to_string(*limits.requests_per_minute) : "none");
  s.audit(request, "organization.quota " + to_string(id) + words);
  return quota(s, id);
}

}  // namespace

void add_organization_routes(Router& router, OrganizationApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };

  const auto admin = Access::any_of({Role::admin});
  router.add({Method::get, "/api/v1/organizations", readers(), on(list)});
  router.add({Method::post, "/api/v1/organizations", admin, on(create)});
  router.add({Method::get, "/api/v1/organizations/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return answer(
                    200, value_or_problem(s.organizations.organization(path_id<OrganizationId>(request))));
              }});
  router.add({Method::patch, "/api/v1/organizations/{id}", admin, on(patch), 1 << 20, false, true});
  router.add({Method::del, "/api/v1/organizations/{id}", admin, on(remove), 1 << 20, false, true});
  router.add({Method::get, "/api/v1/organizations/{id}/quota", readers(), [&s](const Request& request) {
                check_query(request, {});
                return quota(s, path_id<OrganizationId>(request));
              }});
  router.add({Method::put, "/api/v1/organizations/{id}/quota", admin, on(limit)});
}

}  // namespace anchord::api
