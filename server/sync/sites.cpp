// Buildings, floors and pictures of plans, with their site: what no bundle of a flight has.
#include <nlohmann/json.hpp>
#include <set>

#include "api/formats/bundle_manifest.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"
#include "server/sync/taken.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

struct Sending {
  Peer &field, &centre;
  const SyncOptions& options;
  Outcome& outcome;
  Taken taken;
};

Result<void> send(Sending& s, const std::string& id) {
  const std::string what = "site " + id;
  BOOST_OUTCOME_TRY(const auto made, s.field.call({.method = "GET",
                                                   .target = "/api/v1/sites/" + id + "/bundle?flights=false",
                                                   .bundle = true}));
  const auto failed = [&](const server::ClientResponse& answer) {
    refused(s.outcome, s.options, what + ": " + sync::in_words(answer));
    return Result<void>(boost::outcome_v2::success());
  };
  if (made.status != 200) return failed(made);
  BOOST_OUTCOME_TRY(const auto text, manifest_of(made.body));
  BOOST_OUTCOME_TRY(const auto manifest, api::read_site_manifest(text));
  const std::string digest = api::site_bundle_digest(manifest), size = megabytes(made.body.size());
  if (s.taken.has(id, digest)) {
    // It may have been removed there since, or the centre be another one at the same address.
    BOOST_OUTCOME_TRY(const auto there, s.centre.call({"GET", "/api/v1/sites/" + id}));
    if (there.status == 200) return boost::outcome_v2::success();
  }
  if (s.options.dry_run) {
    s.options.report(what + " with its floors: would send " + size);
    return boost::outcome_v2::success();
  }
  s.options.report(what + " with its floors: " + size);
  BOOST_OUTCOME_TRY(const auto answer, s.centre.call({.method = "POST",
                                                      .target = "/api/v1/bundles",
                                                      .body = made.body,
                                                      .type = api::k_site_bundle_type,
                                                      .bundle = true}));
  if (answer.status != 200 && answer.status != 201) return failed(answer);
  const auto json = Json::parse(answer.body, nullptr, false);
  if (text_of(json, "site") != id || text_of(json, "digest") != "sha256:" + digest)
    return s.centre.stranger("POST /api/v1/bundles",
                             "the answer does not belong to the bundle that was sent");
  for (const auto& left : member(json, "left_out"))
    s.options.report(what + ": " + text_of(left, "what") + " left out: " + text_of(left, "why"));
  if (const auto noted = s.taken.note(id, digest); !noted)
    s.options.report(noted.error().message + "; the next run sends this site again");
  return boost::outcome_v2::success();
}

}  // namespace

Result<void> send_sites(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome) {
  BOOST_OUTCOME_TRY(const auto buildings, field.list("/api/v1/buildings?fields=site"));
  std::set<std::string> sites;
  for (const auto& building : buildings) sites.insert(text_of(building, "site"));
  Sending sending{field, centre, options, outcome, Taken(options.state_file, centre.url())};
  for (const auto& site : sites) {
    BOOST_OUTCOME_TRYV(send(sending, site));
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::sync
