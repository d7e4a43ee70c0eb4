// A flight as one file, and back.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/bundle_import.hpp"
#include "api/bundles/range_table.hpp"
#include "api/bundles/routes.hpp"
#include "api/bundles/site_bundle.hpp"
#include "api/bundles/spool.hpp"
#include "api/kit/content_tag.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/base/text.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

Response bundle(BundleApi& s, const Request& request) {
  check_query(request, {});
  const Mission mission = s.named(request);
  auto folder = value_or_problem(SpoolFolder::make(s.spool));
  const auto file = value_or_problem(make_bundle(s, mission, request.principal, *folder));
  return file_answer(std::move(folder), file, k_bundle_type, "mission-" + to_string(mission.id) + ".anchord");
}

Response site_bundle(BundleApi& s, const Request& request) {
  check_query(request, {"flights"});
  const auto flights = request.query_value("flights").value_or("true");
  if (flights != "true" && flights != "false")
    throw_problem(422, "validation", "flights is true or false",
                  {{"/flights", "wrong_type", "must be true or false"}});
  const Site site = value_or_problem(s.sites.site(path_id<SiteId>(request)));
  auto folder = value_or_problem(SpoolFolder::make(s.spool));
  const auto made =
      value_or_problem(make_site_bundle(s, site, request.principal, *folder, flights == "true"));
  const std::string etag = "\"sha256:" + made.digest + '"';
  Response response;
  response.status = 304;
  if (!etag_listed(request.header("if-none-match"), etag))
    response = file_answer(std::move(folder), made.file, k_site_bundle_type,
                           "site-" + to_string(site.id) + ".anchord");
  response.header("ETag", etag);
  return response;
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

/// What is wrong with a file of a stranger is the file's fault: 422, with what to do.
[[noreturn]] void refuse(const Error& error) {
  if (error.code == Errc::bad_frame || error.code == Errc::invalid_argument)
    throw_problem(
        422, "validation",
        error.message + ". Nothing was imported: download the bundle again from the server it comes from");
  throw ProblemException{problem_of(error)};
}
template <class T>
T value_or_refusal(Result<T> result) {
  if (!result) refuse(result.error());
  return std::move(result).value();
}

Ordered with(Ordered head, const Ordered& rest) {
  head.update(rest);
  return head;
}

Response flight_taken(BundleApi& s, const Request& request, const ZipReader& zip) {
  const auto manifest = value_or_refusal(checked_flight(s.bundles, zip));
  const auto outcome = value_or_refusal(take_flight(s, request, zip, manifest));
  Response response = json_response(
      outcome.added() ? 201 : 200,
      with({{"mission", to_string(manifest.mission)}, {"digest", "sha256:" + bundle_digest(manifest)}},
           outcome_json(outcome)));
  response.header("Location", "/api/v1/missions/" + to_string(manifest.mission));
  return response;
}

Response site_taken(BundleApi& s, const Request& request, const ZipReader& zip, const SpoolFolder& folder) {
  const auto manifest = value_or_refusal(checked_site_bundle(zip));
  const auto import = value_or_refusal(take_site_bundle(s, request, zip, manifest, folder));
  Ordered flights = Ordered::array();
  std::string refused;
  for (const auto& flight : import.flights) {
    if (!flight.outcome) refused += (refused.empty() ? "" : "; ") + flight.refused;
    if (flight.outcome)
      flights.push_back(with({{"mission", to_string(flight.mission)}, {"name", to_utf8(flight.name, 200)}},
                             outcome_json(*flight.outcome)));
  }
  if (!refused.empty())
    throw_problem(409, "conflict",
                  refused + ". The other flights of the bundle and the site are on this server now");
  Response response = json_response(
      import.added() ? 201 : 200,
      with(with({{"site", to_string(manifest.site)}, {"digest", "sha256:" + site_bundle_digest(manifest)}},
                outcome_json(import.site)),
           {{"already", !import.added()}, {"flights", std::move(flights)}}));
  response.header("Location", "/api/v1/sites/" + to_string(manifest.site));
  return response;
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
  const ZipReader zip = value_or_refusal(ZipReader::open(file, {.entries = k_site_entries + 64}));
  return is_site_bundle(zip) ? site_taken(s, request, zip, *folder) : flight_taken(s, request, zip);
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
