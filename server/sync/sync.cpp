#include "server/sync/sync.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "server/sync/peer.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

/// Asked before anything is sent: whether an anchord answers there, and whether it takes what will be sent.
Result<void> check_centre(Peer& centre, const SyncOptions& options) {
  BOOST_OUTCOME_TRY(const auto version, centre.get("/version"));
  if (text_of(version, "version").empty()) return centre.stranger("/version", "the answer has no version");
  BOOST_OUTCOME_TRY(const auto me, centre.get("/api/v1/me"));
  const Json& roles = member(me, "roles");
  const auto may = [](const Json& role) { return role == "engineer" || role == "admin"; };
  if (!roles.is_array() || std::none_of(roles.begin(), roles.end(), may))
    return make_error(Errc::invalid_argument, centre.url() + ": the token of " + text_of(me, "name") +
                                                  " does not have the role engineer: create one there with "
                                                  "'anchord token create NAME --role engineer'");
  options.report(centre.url() + ": anchord " + text_of(version, "version"));
  return boost::outcome_v2::success();
}

}  // namespace

void refused(Outcome& outcome, const SyncOptions& options, const std::string& what) {
  outcome.failed.push_back(what);
  options.report(what);
}

Result<Outcome> sync_up(Peer& field, Peer& centre, const SyncOptions& options) {
  Outcome outcome;
  BOOST_OUTCOME_TRYV(check_centre(centre, options));
  BOOST_OUTCOME_TRYV(send_sites(field, centre, options, outcome));
  BOOST_OUTCOME_TRYV(send_flights(field, centre, options, outcome));
  BOOST_OUTCOME_TRYV(send_models(field, centre, options, outcome));
  BOOST_OUTCOME_TRYV(publish_positions(field, centre, options, outcome));
  return outcome;
}

}  // namespace anchord::sync
