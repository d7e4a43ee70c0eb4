// Published positions. Each anchor is compared by itself, as files are in a merge: the calibration that its
// position rests on here and there, and those that it rested on before.
#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "api/kit/support.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

struct Position {
  std::string network_id, site, calibration, override_reason, revision, calibrated_at;
  std::optional<Wgs84> at{};
  std::size_t bytes() const {
    return network_id.size() + site.size() + calibration.size() + override_reason.size() + revision.size() +
           calibrated_at.size();
  }
};

/// What a stranger in a server's place may send and we keep.
constexpr std::size_t k_most_positions = 500'000, k_most_position_bytes = 2'000;

std::optional<Wgs84> point_of(const Json& feature) {
  const Json& c = member(member(feature, "geometry"), "coordinates");
  if (!c.is_array() || c.size() != 3) return std::nullopt;
  for (const auto& one : c)
    if (!one.is_number()) return std::nullopt;
  return Wgs84{c[1].get<double>(), c[0].get<double>(), c[2].get<double>()};
}

Position position_of(const Json& feature) {
  Position out;
  const Json& p = member(feature, "properties");
  out.network_id = text_of(p, "network_id");
  out.site = text_of(p, "site");
  out.calibration = text_of(member(p, "provenance"), "calibration");
  out.override_reason = text_of(member(member(p, "quality"), "override"), "reason");
  out.revision = to_wire(member(p, "revision"));
  out.calibrated_at = text_of(p, "calibrated_at");
  out.at = point_of(feature);
  return out;
}

std::string in_words(const Position& position) {
  char at[80] = "not on the globe";
  if (position.at)
    std::snprintf(at, sizeof at, "%.9f, %.9f, %.3f m", position.at->lat_deg, position.at->lon_deg,
                  position.at->height_m);
  return std::string(at) + ", revision " + position.revision + ", calibrated " + position.calibrated_at;
}

/// By network id; those whose calibration is known, of all sites or of these.
Result<std::map<std::string, Position>> published(Peer& peer, const std::vector<Site>* sites = nullptr) {
  std::vector<std::string> targets;
  if (sites == nullptr) targets.emplace_back("/api/v1/anchors");
  for (const auto& site : sites ? *sites : std::vector<Site>{})
    targets.push_back("/api/v1/anchors?site=" + api::percent_encoded(site.id));
  std::map<std::string, Position> out;
  for (const auto& target : targets) {
    BOOST_OUTCOME_TRYV(peer.each(target, [&](const Json& feature) -> Result<void> {
      auto position = position_of(feature);
      if (position.bytes() > k_most_position_bytes || out.size() >= k_most_positions)
        return peer.stranger(target, "more or longer positions than a server has");
      if (!position.calibration.empty()) out.emplace(position.network_id, std::move(position));
      return boost::outcome_v2::success();
    }));
  }
  return out;
}

/// Whether the anchor's position rested on this calibration at some time.
Result<bool> had(Peer& peer, const std::string& network_id, const std::string& calibration) {
  BOOST_OUTCOME_TRY(const auto history, peer.get(path_of("anchors", network_id, "/history")));
  for (const auto& item : member(history, "items"))
    if (text_of(item, "calibration") == calibration) return true;
  return false;
}

class Positions {
 public:
  explicit Positions(Run& run) : run_(run), out_(run.outcome) {}

  Result<void> compare_all() {
    const bool some = !run_.options.sites.empty();
    BOOST_OUTCOME_TRY(const auto ours, published(run_.source(), some ? &run_.sites : nullptr));
    if (ours.empty()) return boost::outcome_v2::success();
    BOOST_OUTCOME_TRY(const auto theirs, published(run_.target()));
    BOOST_OUTCOME_TRY(const auto sites, run_.source().list("/api/v1/sites?fields=id,name"));
    for (const auto& site : sites) site_names_[text_of(site, "id")] = text_of(site, "name");
    for (const auto& [id, mine] : ours) {
      const auto there = theirs.find(id);
      if (there == theirs.end()) {
        wanted_[mine.calibration].push_back({mine, {}, {}});
        continue;
      }
      BOOST_OUTCOME_TRYV(compare(mine, there->second));
    }
    decide();
    return boost::outcome_v2::success();
  }
  std::set<std::string> calibrations() const {
    std::set<std::string> out;
    for (const auto& [calibration, anchors] : wanted_) out.insert(calibration);
    return out;
  }
  Result<void> publish_all() {
    for (const auto& [calibration, anchors] : wanted_) {
      BOOST_OUTCOME_TRYV(publish(calibration, anchors));
    }
    return boost::outcome_v2::success();
  }

 private:
  struct Wanted {
    Position position;
    std::string over;     ///< the revision at the target that it follows; empty: none
    std::string decided;  ///< by a person; also the reason where a gate fails there
  };

  Result<void> compare(const Position& mine, const Position& there) {
    if (mine.calibration == there.calibration) {
      ++out_.anchors_there;
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(const bool source_moved_on, had(run_.source(), mine.network_id, there.calibration));
    if (source_moved_on) {
      wanted_[mine.calibration].push_back({mine, there.revision, {}});
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(const bool target_moved_on, had(run_.target(), mine.network_id, mine.calibration));
    if (target_moved_on) {
      ++out_.anchors_there;
      return boost::outcome_v2::success();
    }
    conflicts_[mine.site].emplace_back(mine, there);
    return boost::outcome_v2::success();
  }

  void decide() {
    const Keep of_target = run_.up() ? Keep::centre : Keep::field;
    for (const auto& [site, anchors] : conflicts_) {
      const std::string& name = site_names_[site];
      const auto keep = run_.options.decisions.of(site, name);
      if (!keep) {
        out_.undecided.push_back(conflict(site, name, anchors));
      } else if (keep == of_target) {
        out_.anchors_left += anchors.size();
      } else {
        for (const auto& [mine, there] : anchors)
          wanted_[mine.calibration].push_back({mine, there.revision,
                                               "kept instead of revision " + there.revision + " of the " +
                                                   std::string(k_keep_words.word(of_target))});
      }
    }
  }

  Conflict conflict(const std::string& site, const std::string& name,
                    const std::vector<std::pair<Position, Position>>& anchors) const {
    Conflict out{site, name, {}};
    for (const auto& [mine, there] : anchors) {
      std::optional<double> distance_m;
      if (mine.at && there.at) distance_m = EnuFrame(*there.at).enu_from_wgs84(*mine.at).m.norm();
      const auto &field = run_.up() ? mine : there, &centre = run_.up() ? there : mine;
      out.anchors.push_back({mine.network_id, in_words(field), in_words(centre), distance_m});
    }
    return out;
  }

  Result<void> publish(const std::string& calibration, const std::vector<Wanted>& anchors) {
    const std::string name =
        "calibration " + calibration + ", " + std::to_string(anchors.size()) + " anchors";
    if (run_.options.dry_run) {
      run_.report(name + ": would publish");
      return boost::outcome_v2::success();
    }
    Json body{{"anchors", Json::array()}, {"overrides", Json::array()}};
    std::string note = "anchord sync from " + run_.source().url();
    Sha256 once;
    once.add(calibration);
    for (const auto& [position, over, decided] : anchors) {
      body["anchors"].push_back(position.network_id);
      once.add(position.network_id + ' ' + over + '\n');
      const auto& reason = position.override_reason.empty() ? decided : position.override_reason;
      if (!reason.empty())
        body["overrides"].push_back({{"network_id", position.network_id}, {"reason", reason}});
    }
    if (const auto over =
            std::ranges::find_if(anchors, [](const Wanted& one) { return !one.decided.empty(); });
        over != anchors.end())
      note += ": " + over->decided;
    body["note"] = note;
    const std::string text = to_wire(body);
    PeerRequest request{"POST", path_of("calibrations", calibration, "/publish"), text};
    // An answer that was lost must not become a second revision.
    request.headers.emplace("Idempotency-Key", "sync-" + once.hex());
    BOOST_OUTCOME_TRY(const auto answer, run_.target().call(request));
    if (answer.status == 201) {
      out_.anchors_published += anchors.size();
      run_.report(name + ": published");
    } else {
      run_.failed(name + ": " + sync::in_words(answer));
    }
    return boost::outcome_v2::success();
  }

  Run& run_;
  Outcome& out_;
  std::map<std::string, std::string> site_names_;
  /// By calibration; ids are of their time, so oldest first.
  std::map<std::string, std::vector<Wanted>> wanted_;
  std::map<std::string, std::vector<std::pair<Position, Position>>> conflicts_;  ///< by site: source, target
};

}  // namespace

std::optional<Keep> Decisions::of(const std::string& site_id, const std::string& site_name) const {
  for (const auto& word : {site_id, site_name}) {
    if (const auto at = by_site.find(word); at != by_site.end()) return at->second;
  }
  return everywhere;
}

Result<std::set<std::string>> wanted_calibrations(const Run& run) {
  Run apart{run.field, run.centre, run.options, {}, run.sites, run.whole_servers};
  Positions positions(apart);
  BOOST_OUTCOME_TRYV(positions.compare_all());
  return positions.calibrations();
}

Result<void> publish_positions(Run& run) {
  Positions positions(run);
  BOOST_OUTCOME_TRYV(positions.compare_all());
  return positions.publish_all();
}

}  // namespace anchord::sync
