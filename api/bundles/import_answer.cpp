#include "api/bundles/import_answer.hpp"

#include <nlohmann/json.hpp>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/bundle_import.hpp"
#include "api/bundles/site_bundle.hpp"
#include "api/bundles/spool.hpp"
#include "api/kit/support.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

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

}  // namespace

Response import_answer(BundleApi& s, const Request& request, const std::filesystem::path& file,
                       const SpoolFolder& folder) {
  const ZipReader zip = value_or_refusal(ZipReader::open(file, {.entries = k_site_entries + 64}));
  return is_site_bundle(zip) ? site_taken(s, request, zip, folder) : flight_taken(s, request, zip);
}

}  // namespace anchord::api
