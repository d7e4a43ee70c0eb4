// A flight as one file, and back.
#include "api/bundles/bundle_file.hpp"
#include "api/bundles/import_answer.hpp"
#include "api/bundles/kept_bundles.hpp"
#include "api/bundles/range_table.hpp"
#include "api/bundles/routes.hpp"
#include "api/bundles/site_bundle.hpp"
#include "api/bundles/spool.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {
namespace {

Response bundle(BundleApi& s, const Request& request) {
  check_query(request, {});
  const Mission mission = s.named(request);
  const std::string name = "mission-" + to_string(mission.id) + ".anchord";
  if (auto part = kept_part(s.spool, request, k_bundle_type, name)) return *std::move(part);
  auto folder = value_or_problem(SpoolFolder::make(s.spool));
  auto made = value_or_problem(make_bundle(s, mission, request.principal, *folder));
  return bundle_answer(s.spool, request, std::move(folder), {made.file, made.digest, k_bundle_type, name});
}

Response site_bundle(BundleApi& s, const Request& request) {
  check_query(request, {"flights"});
  const auto flights = request.query_value("flights").value_or("true");
  if (flights != "true" && flights != "false")
    throw_problem(422, "validation", "flights is true or false",
                  {{"/flights", "wrong_type", "must be true or false"}});
  const Site site = value_or_problem(s.sites.site(path_id<SiteId>(request)));
  const std::string name = "site-" + to_string(site.id) + ".anchord";
  if (auto part = kept_part(s.spool, request, k_site_bundle_type, name)) return *std::move(part);
  auto folder = value_or_problem(SpoolFolder::make(s.spool));
  const auto made =
      value_or_problem(make_site_bundle(s, site, request.principal, *folder, flights == "true"));
  return bundle_answer(s.spool, request, std::move(folder),
                       {made.file, made.digest, k_site_bundle_type, name});
}

Response ranges_file(BundleApi& s, const Request& request) {
  check_query(request, {});
  const Mission mission = s.named(request);
  auto folder = value_or_problem(SpoolFolder::make(s.spool));
  const auto file = folder->path("ranges.gpkg");
  value_or_problem(write_ranges(s.measurements, mission.id, s.feature_file, file, s.clock.now()));
  return file_answer(std::move(folder), file, "application/geopackage+sqlite3",
                     "ranges-" + to_string(mission.id) + ".gpkg");
}

/// A flight or a site: the file says which.
Response take(BundleApi& s, const Request& request) {
  check_query(request, {});
  const std::string type = media_type(request);
  if (type != k_bundle_type && type != k_site_bundle_type && type != "application/zip" &&
      type != "application/octet-stream")
    throw_problem(415, "media-type", std::string("send the bundle with Content-Type: ") + k_bundle_type);
  const auto folder = value_or_problem(SpoolFolder::make(s.spool));
  const auto file = folder->path("upload");
  if (spool_body(request, file) == 0) throw_problem(422, "validation", "the body is empty: send a bundle");
  return import_answer(s, request, file, *folder);
}

}  // namespace

void add_bundle_routes(Router& router, BundleApi& s) {
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/bundle", readers(),
                       [&s](const Request& request) { return bundle(s, request); }}));
  router.add(as_heavy({Method::get, "/api/v1/sites/{id}/bundle", readers(),
                       [&s](const Request& request) { return site_bundle(s, request); }}));
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/ranges.gpkg", readers(),
                       [&s](const Request& request) { return ranges_file(s, request); }}));
  router.add({Method::post, "/api/v1/bundles", Access::any_of({Role::engineer}),
              [&s](const Request& request) { return take(s, request); }, k_bundle_bytes, true});
}

}  // namespace anchord::api
