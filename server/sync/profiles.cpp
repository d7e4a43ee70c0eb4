// What was learned of each kit. A profile is what its flights say of it, one factor each: one that has all
// factors of another goes on from it.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/to_wire.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

struct Profile {
  Json json;         ///< null: the server has none
  std::string etag;  ///< of its version
};

Result<Profile> profile_at(Peer& peer, const std::string& kit) {
  BOOST_OUTCOME_TRY(const auto answer, peer.call({"GET", path_of("devices", kit, "/profile")}));
  if (answer.status == 404) return Profile{};
  const auto json = json_of(answer);
  const auto etag = answer.headers.find("etag");
  if (answer.status != 200 || text_of(json, "kit") != kit || etag == answer.headers.end())
    return peer.stranger(path_of("devices", kit, "/profile"), sync::in_words(answer));
  return Profile{member(json, "profile"), etag->second};
}

/// Beside the factors, what a profile says of itself must be the same.
bool goes_on_from(const Json& later, const Json& earlier) {
  Json a = later, b = earlier;
  std::set<std::string> factors;
  for (const auto& factor : member(a, "factors")) factors.insert(to_wire(factor));
  for (const auto& factor : member(b, "factors"))
    if (!factors.contains(to_wire(factor))) return false;
  a["factors"] = b["factors"] = nullptr;
  return a == b;
}

Result<void> send_profile(Run& run, const std::string& kit) {
  const std::string name = "profile of kit '" + kit + "'";
  BOOST_OUTCOME_TRY(const auto ours, profile_at(run.source(), kit));
  if (!ours.json.is_object()) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(const auto there, profile_at(run.target(), kit));
  if (there.json.is_object() && goes_on_from(there.json, ours.json)) {
    ++run.outcome.profiles_there;
    return boost::outcome_v2::success();
  }
  if (there.json.is_object() && !goes_on_from(ours.json, there.json)) {
    run.outcome.differs.insert(name + " stays as it is " + (run.up() ? "there" : "here") +
                               ": both sides learned something else of it");
    return boost::outcome_v2::success();
  }
  if (run.options.dry_run) {
    run.report(name + (run.up() ? ": would send" : ": would be taken"));
    return boost::outcome_v2::success();
  }
  const std::string text = to_wire(ours.json);
  PeerRequest put{"PUT", path_of("devices", kit, "/profile"), text};
  put.headers.emplace("If-Match", there.json.is_object() ? there.etag : "*");
  BOOST_OUTCOME_TRY(const auto answer, run.target().call(put));
  if (answer.status == 200 || answer.status == 201) {
    ++run.outcome.profiles_sent;
    run.report(name + ": stored");
    return boost::outcome_v2::success();
  }
  // The answer to one that was stored may have been lost.
  BOOST_OUTCOME_TRY(const auto now, profile_at(run.target(), kit));
  if (now.json == ours.json)
    ++run.outcome.profiles_sent;
  else
    run.failed(name + ": " + sync::in_words(answer));
  return boost::outcome_v2::success();
}

}  // namespace

Result<void> send_profiles(Run& run) {
  if (!run.whole_servers) return boost::outcome_v2::success();
  std::set<std::string> kits;
  BOOST_OUTCOME_TRYV(
      run.source().each("/api/v1/missions?fields=kit", [&](const Json& mission) -> Result<void> {
        kits.insert(text_of(mission, "kit"));
        return boost::outcome_v2::success();
      }));
  kits.erase("");
  for (const auto& kit : kits) {
    BOOST_OUTCOME_TRYV(send_profile(run, kit));
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::sync
