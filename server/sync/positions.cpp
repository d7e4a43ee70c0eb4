// Published positions. Each anchor is compared by itself, as files are in a merge: the calibration that its
// position rests on here and there, and those that it rested on before.
#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

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
};

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

/// By network id; those whose calibration is known.
Result<std::map<std::string, Position>> published(Peer& peer) {
  BOOST_OUTCOME_TRY(const auto features, peer.list("/api/v1/anchors"));
  std::map<std::string, Position> out;
  for (const auto& feature : features) {
    auto position = position_of(feature);
    if (!position.calibration.empty()) out.emplace(position.network_id, std::move(position));
  }
  return out;
}

/// Whether the anchor's position rested on this calibration at some time.
Result<bool> had(Peer& peer, const std::string& network_id, const std::string& calibration) {
  BOOST_OUTCOME_TRY(const auto history, peer.get("/api/v1/anchors/" + network_id + "/history"));
  for (const auto& item : member(history, "items"))
    if (text_of(item, "calibration") == calibration) return true;
  return false;
}

class Positions {
 public:
  Positions(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome)
      : field_(field), centre_(centre), options_(options), out_(outcome) {}

  Result<void> run() {
    BOOST_OUTCOME_TRY(const auto ours, published(field_));
    if (ours.empty()) return boost::outcome_v2::success();
    BOOST_OUTCOME_TRY(const auto theirs, published(centre_));
    BOOST_OUTCOME_TRY(const auto sites, field_.list("/api/v1/sites?fields=id,name"));
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
    for (const auto& [calibration, anchors] : wanted_) {
      BOOST_OUTCOME_TRYV(publish(calibration, anchors));
    }
    return boost::outcome_v2::success();
  }

 private:
  struct Wanted {
    Position position;
    std::string over;     ///< the revision at the centre that it follows; empty: none
    std::string decided;  ///< by a person; also the reason where a gate fails there
  };

  Result<void> compare(const Position& mine, const Position& there) {
    if (mine.calibration == there.calibration) {
      ++out_.anchors_there;
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(const bool field_moved_on, had(field_, mine.network_id, there.calibration));
    if (field_moved_on) {
      wanted_[mine.calibration].push_back({mine, there.revision, {}});
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(const bool centre_moved_on, had(centre_, mine.network_id, mine.calibration));
    if (centre_moved_on) {
      ++out_.anchors_there;
      return boost::outcome_v2::success();
    }
    conflicts_[mine.site].emplace_back(mine, there);
    return boost::outcome_v2::success();
  }

  void decide() {
    for (const auto& [site, anchors] : conflicts_) {
      const std::string& name = site_names_[site];
      const auto keep = options_.decisions.of(site, name);
      if (keep == Keep::centre) {
        out_.anchors_left += anchors.size();
      } else if (keep == Keep::field) {
        for (const auto& [mine, there] : anchors)
          wanted_[mine.calibration].push_back(
              {mine, there.revision, "kept instead of revision " + there.revision + " of the centre"});
      } else {
        Conflict conflict{site, name, {}};
        for (const auto& [mine, there] : anchors) {
          std::optional<double> distance_m;
          if (mine.at && there.at) distance_m = EnuFrame(*there.at).enu_from_wgs84(*mine.at).m.norm();
          conflict.anchors.push_back({mine.network_id, in_words(mine), in_words(there), distance_m});
        }
        out_.undecided.push_back(std::move(conflict));
      }
    }
  }

  Result<void> publish(const std::string& calibration, const std::vector<Wanted>& anchors) {
    const std::string name =
        "calibration " + calibration + ", " + std::to_string(anchors.size()) + " anchors";
    if (options_.dry_run) {
      options_.report(name + ": would publish");
      return boost::outcome_v2::success();
    }
    Json body{{"anchors", Json::array()}, {"overrides", Json::array()}};
    std::string note = "anchord sync from " + field_.url();
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
    PeerRequest request{"POST", "/api/v1/calibrations/" + calibration + "/publish", text};
    // An answer that was lost must not become a second revision.
    request.idempotency_key = "sync-" + once.hex();
    BOOST_OUTCOME_TRY(const auto answer, centre_.call(request));
    if (answer.status == 201) {
      out_.anchors_published += anchors.size();
      options_.report(name + ": published");
    } else {
      refused(out_, options_, name + ": " + sync::in_words(answer));
    }
    return boost::outcome_v2::success();
  }

  Peer& field_;
  Peer& centre_;
  const SyncOptions& options_;
  Outcome& out_;
  std::map<std::string, std::string> site_names_;
  /// By calibration; ids are of their time, so oldest first.
  std::map<std::string, std::vector<Wanted>> wanted_;
  std::map<std::string, std::vector<std::pair<Position, Position>>> conflicts_;  ///< by site: here, there
};

}  // namespace

std::optional<Keep> Decisions::of(const std::string& site_id, const std::string& site_name) const {
  for (const auto& word : {site_id, site_name}) {
    if (const auto at = by_site.find(word); at != by_site.end()) return at->second;
  }
  return everywhere;
}

Result<void> publish_positions(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome) {
  return Positions(field, centre, options, outcome).run();
}

}  // namespace anchord::sync
