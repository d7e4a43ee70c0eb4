#include "server/sync/sync.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string_view>

#include "server/sync/peer.hpp"
#include "server/sync/transfer.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

constexpr std::array<std::string_view, 2> k_writers{"engineer", "admin"};
constexpr std::array<std::string_view, 5> k_readers{"viewer", "integrator", "engineer", "operator", "admin"};

/// Asked before anything is sent: whether an anchord answers there, and whether its token may do what will
/// be asked of it.
Result<void> check(Run& run, Peer& peer, std::span<const std::string_view> roles) {
  BOOST_OUTCOME_TRY(const auto version, peer.get("/version"));
  if (text_of(version, "version").empty()) return peer.stranger("/version", "the answer has no version");
  BOOST_OUTCOME_TRY(const auto me, peer.get("/api/v1/me"));
  const Json& has = member(me, "roles");
  const auto may = [&](const Json& role) {
    return role.is_string() && std::ranges::count(roles, role.get<std::string>()) > 0;
  };
  const std::string least(roles.front());
  if (!has.is_array() || std::none_of(has.begin(), has.end(), may))
    return make_error(Errc::invalid_argument, peer.url() + ": the token of " + text_of(me, "name") +
                                                  " does not have the role " + least +
                                                  ": create one there with 'anchord token create --name NAME "
                                                  "--role " +
                                                  least + "'");
  if (member(me, "sites").is_array()) run.whole_servers = false;
  peer.set_known();
  if (&peer == &run.centre) run.report(peer.url() + ": anchord " + text_of(version, "version"));
  return boost::outcome_v2::success();
}

/// Those of the command line, each known there by its id or its only name.
Result<std::vector<Site>> chosen_sites(const Run& run) {
  BOOST_OUTCOME_TRY(const auto listed, run.centre.list("/api/v1/sites?fields=id,name"));
  std::vector<Site> all, out;
  for (const auto& site : listed) all.push_back({text_of(site, "id"), text_of(site, "name")});
  if (run.options.sites.empty()) return all;
  for (const auto& word : run.options.sites) {
    std::vector<Site> found;
    for (const auto& site : all)
      if (site.id == word || site.name == word) found.push_back(site);
    if (found.empty())
      return make_error(Errc::invalid_argument,
                        "--site " + word + ": " + run.centre.url() +
                            " has no site of this name or id that the token may read");
    if (found.size() > 1)
      return make_error(Errc::invalid_argument, "--site " + word + ": " + std::to_string(found.size()) +
                                                    " sites have this name, give the id: " + found[0].id +
                                                    " or " + found[1].id);
    out.push_back(found.front());
  }
  return out;
}

/// The name of what a bundle names by its kind and id, as the target has it; empty where it has none.
std::string name_at(Peer& target, const std::string& what) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> k_kinds{
      {{"site", "sites"},
       {"plan", "plans"},
       {"local_frame", "frames"},
       {"building", "buildings"},
       {"building_floor", "floors"},
       {"anchor", "anchors"}}};
  const auto blank = what.find(' ');
  if (blank == std::string::npos) return {};
  for (const auto& [kind, path] : k_kinds) {
    if (kind != std::string_view(what).substr(0, blank)) continue;
    const auto found = target.get(path_of(path, what.substr(blank + 1)));
    if (!found) return {};
    const auto name = text_of(found.value(), "name");
    return name.empty() ? text_of(member(found.value(), "properties"), "name") : name;
  }
  return {};
}

Result<void> up(Run& run) {
  BOOST_OUTCOME_TRYV(send_sites(run));
  BOOST_OUTCOME_TRYV(send_flights(run, nullptr));
  BOOST_OUTCOME_TRYV(send_models(run));
  BOOST_OUTCOME_TRYV(send_profiles(run));
  return publish_positions(run);
}

Result<void> down(Run& run) {
  BOOST_OUTCOME_TRY(run.sites, chosen_sites(run));
  BOOST_OUTCOME_TRYV(send_sites(run));
  BOOST_OUTCOME_TRY(const auto wanted, wanted_calibrations(run));
  BOOST_OUTCOME_TRYV(send_flights(run, &wanted));
  BOOST_OUTCOME_TRYV(send_models(run));
  BOOST_OUTCOME_TRYV(send_profiles(run));
  return publish_positions(run);
}

}  // namespace

void Run::failed(const std::string& what) {
  outcome.failed.push_back(what);
  report(what);
}

void Run::left_out(const std::string& of, const std::string& what, const std::string& why) {
  if (up()) return report(of + ": " + what + " left out: " + why);
  const auto name = name_at(target(), what);
  const auto kind = what.substr(0, what.find(' '));
  outcome.differs.insert((name.empty() ? what : kind + " '" + name + "'") + " stays as it is here: " + why);
}

Result<Outcome> sync(Peer& field, Peer& centre, const SyncOptions& options) {
  Run run{field, centre, options};
  BOOST_OUTCOME_TRYV(
      check(run, run.centre, run.up() ? std::span<const std::string_view>(k_writers) : k_readers));
  BOOST_OUTCOME_TRYV(
      check(run, run.field, run.up() ? std::span<const std::string_view>(k_readers) : k_writers));
  if (!run.whole_servers)
    run.report(
        "a token is bound to sites: models and profiles of kits do not go, which are of the whole server");
  remove_old_parts(run);
  BOOST_OUTCOME_TRYV(run.up() ? up(run) : down(run));
  return std::move(run.outcome);
}

}  // namespace anchord::sync
