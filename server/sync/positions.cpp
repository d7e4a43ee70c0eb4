// Published positions. Each anchor is looked at by itself, as files are in a merge: the calibration that its
// position rests on here and there, and those that it rested on before.
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

struct Position {
  std::string network_id, site, calibration, override_reason, shown;
};

Position position_of(const Json& feature) {
  Position out;
  const auto p = feature.value("properties", Json::object());
  out.network_id = text_of(p, "network_id");
  out.site = text_of(p, "site");
  out.calibration = text_of(p.value("provenance", Json::object()), "calibration");
  if (const auto quality = p.find("quality"); quality != p.end() && quality->is_object()) {
    if (const auto reason = quality->find("override"); reason != quality->end() && reason->is_object())
      out.override_reason = text_of(*reason, "reason");
  }
  out.shown = "revision " + (p.contains("revision") ? to_wire(p["revision"]) : std::string("?")) +
              ", calibrated " + text_of(p, "calibrated_at");
  return out;
}

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
Result<bool> knew(Peer& peer, const std::string& network_id, const std::string& calibration) {
  BOOST_OUTCOME_TRY(const auto history, peer.list("/api/v1/anchors/" + network_id + "/history"));
  for (const auto& item : history) {
    if (text_of(item, "calibration") == calibration) return true;
  }
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
        wanted_[mine.calibration].push_back({mine, {}});
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
    std::string decided;  ///< the reason that overrides the gates there; empty: none but its own
  };

  Result<void> compare(const Position& mine, const Position& there) {
    if (mine.calibration == there.calibration) {
      ++out_.anchors_there;
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(const bool moved_on_here, knew(field_, mine.network_id, there.calibration));
    if (moved_on_here) {
      wanted_[mine.calibration].push_back({mine, {}});
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(const bool moved_on_there, knew(centre_, mine.network_id, mine.calibration));
    if (moved_on_there) {
      ++out_.anchors_there;
      return boost::outcome_v2::success();
    }
    auto& conflict = conflicts_[mine.site];
    conflict.first.anchors.push_back(mine.network_id);
    conflict.first.ours = mine.shown;
    conflict.first.theirs = there.shown;
    conflict.second.push_back(mine);
    return boost::outcome_v2::success();
  }

  void decide() {
    for (auto& [site, found] : conflicts_) {
      auto& [conflict, anchors] = found;
      conflict.site_id = site;
      conflict.site_name = site_names_[site];
      const auto keep = options_.decisions.of(site, conflict.site_name);
      if (!keep) {
        out_.undecided.push_back(conflict);
      } else if (*keep == Keep::theirs) {
        out_.anchors_left += anchors.size();
      } else {
        for (const auto& one : anchors)
          wanted_[one.calibration].push_back(
              {one, "kept by a person over " + conflict.theirs + " (anchord sync --keep ours)"});
      }
    }
  }

  Result<void> publish(const std::string& calibration, const std::vector<Wanted>& anchors) {
    const std::string name =
        "calibration " + calibration + ", " + std::to_string(anchors.size()) + " anchors";
    if (options_.dry_run) {
      options_.tell(name + ": would publish");
      return boost::outcome_v2::success();
    }
    Json body{{"anchors", Json::array()},
              {"overrides", Json::array()},
              {"note", "by anchord sync from " + field_.url()}};
    for (const auto& [position, decided] : anchors) {
      body["anchors"].push_back(position.network_id);
      const auto& reason = position.override_reason.empty() ? decided : position.override_reason;
      if (!reason.empty())
        body["overrides"].push_back({{"network_id", position.network_id}, {"reason", reason}});
    }
    BOOST_OUTCOME_TRY(
        const auto answer,
        centre_.call("POST", "/api/v1/calibrations/" + calibration + "/publish", to_wire(body)));
    if (answer.status == 201) {
      out_.anchors_published += anchors.size();
      options_.tell(name + ": published");
    } else {
      out_.failed.push_back(name + ": " + told(answer));
      options_.tell(out_.failed.back());
    }
    return boost::outcome_v2::success();
  }

  Peer& field_;
  Peer& centre_;
  const SyncOptions& options_;
  Outcome& out_;
  std::map<std::string, std::string> site_names_;
  std::map<std::string, std::vector<Wanted>>
      wanted_;  ///< by calibration; ids are of their time, so oldest first
  std::map<std::string, std::pair<Conflict, std::vector<Position>>> conflicts_;
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

Result<Outcome> sync_up(Peer& field, Peer& centre, const SyncOptions& options) {
  Outcome outcome;
  BOOST_OUTCOME_TRYV(send_flights(field, centre, options, outcome));
  BOOST_OUTCOME_TRYV(send_models(field, centre, options, outcome));
  BOOST_OUTCOME_TRYV(publish_positions(field, centre, options, outcome));
  return outcome;
}

}  // namespace anchord::sync
