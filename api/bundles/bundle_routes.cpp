// A flight as one file, and back.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/range_table.hpp"
#include "api/bundles/routes.hpp"
#include "api/bundles/spool.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/base/text.hpp"

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

/// Every table once, and beside them notes alone.
void check_entries(const BundleStore& store, const BundleManifest& manifest) {
  std::string wrong;
  for (const auto& table : store.tables()) {
    if (std::ranges::find(manifest.entries, bundle_entry_name(table), &BundleEntry::name) ==
        manifest.entries.end())
      wrong += (wrong.empty() ? "" : ", ") + bundle_entry_name(table) + " is missing";
  }
  for (const auto& entry : manifest.entries) {
    const bool table = std::ranges::any_of(
        store.tables(), [&](const BundleTable& t) { return bundle_entry_name(t) == entry.name; });
    if (!table && !entry.name.starts_with(k_bundle_notes))
      wrong += (wrong.empty() ? "" : ", ") + entry.name + " is not part of a bundle";
  }
  if (!wrong.empty()) refuse(make_error(Errc::bad_frame, wrong));
}

Ordered outcome_json(const BundleManifest& manifest, const BundleOutcome& outcome) {
  Ordered rows = Ordered::object(), added = Ordered::object(), left_out = Ordered::array();
  for (const auto& table : outcome.tables) {
    if (table.n_rows > 0) rows[table.name] = table.n_rows;
    if (table.n_added > 0) added[table.name] = table.n_added;
  }
  for (const auto& one : outcome.left_out) left_out.push_back({{"what", one.what}, {"why", one.why}});
  return {{"mission", to_string(manifest.mission)},
          {"digest", "sha256:" + bundle_digest(manifest)},
          {"already", !outcome.added()},
          {"rows", std::move(rows)},
          {"added", std::move(added)},
          {"left_out", std::move(left_out)}};
}

Response take(BundleApi& s, const Request& request) {
  check_query(request, {});
  const std::string type = media_type(request);
  if (type != k_bundle_type && type != "application/zip" && type != "application/octet-stream")
    throw_problem(415, "media-type", std::string("send the bundle with Content-Type: ") + k_bundle_type);
  const auto folder = value_or_problem(SpoolFolder::make(s.spool));
  const auto file = folder->path("upload");
  if (spool_body(request, file) == 0) throw_problem(422, "validation", "the body is empty: send a bundle");
  const ZipReader zip = value_or_refusal(ZipReader::open(file));
  const BundleManifest manifest = value_or_refusal(checked_bundle(zip));
  check_entries(s.bundles, manifest);
  BundleZipSource source(zip);
  const BundleOutcome outcome = value_or_refusal(s.bundles.take_in(manifest.mission, source));
  s.audit(request, "bundle.import " + to_string(manifest.mission) + " sha256:" + bundle_digest(manifest),
          outcome.added() ? "ok" : "already here");
  if (outcome.added())
    s.taken(manifest.mission,
            to_utf8(manifest.mission_name, 200) + " was imported from a bundle, by " + request.principal.name,
            std::ranges::any_of(outcome.tables, [](const auto& table) {
              return table.name == "revision" && table.n_added > 0;
            }));
  Response response = json_response(outcome.added() ? 201 : 200, outcome_json(manifest, outcome));
  response.header("Location", "/api/v1/missions/" + to_string(manifest.mission));
  return response;
}

}  // namespace

void add_bundle_routes(Router& router, BundleApi& s) {
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/bundle", readers(),
                       [&s](const Request& request) { return bundle(s, request); }}));
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/ranges.gpkg", readers(),
                       [&s](const Request& request) { return ranges_file(s, request); }}));
  router.add({Method::post, "/api/v1/bundles", Access::any_of({Role::engineer}),
              [&s](const Request& request) { return take(s, request); }, k_bundle_bytes, true});
}

}  // namespace anchord::api
