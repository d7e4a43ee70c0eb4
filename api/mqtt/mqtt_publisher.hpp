#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/steady.hpp"
#include "core/ports/broker.hpp"

namespace anchord {
class MissionStore;
class RevisionStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class Hub;
struct AnchorFeature;

/// What this server has, as retained topics of an MQTT broker:
///
///   PREFIX/_server/status, alarms, revision     presence (also the last will), all that stand, the newest
///   PREFIX/SITE/anchors/0x6a2f                  published: the feature of GET /anchors
///   PREFIX/SITE/mission                         of the newest mission of the site: topic mission.state
///   PREFIX/SITE/estimates/0x6a2f                of the same mission: topic anchors.estimates
///
/// SITE is the site's name (topic_name.hpp), with '~' and the end of its id where an older site has the same;
/// `_none` without a site. Used on the broker's thread alone.
class MqttPublisher final : public BrokerSource {
 public:
  struct Deps {
    const Hub& hub;
    MissionStore& missions;
    SiteStore& sites;
    RevisionStore& revisions;
    std::function<std::vector<AnchorFeature>()> published;  ///< of the newest revision
    const SteadyClock& steady;
    std::string prefix, version;
  };
  explicit MqttPublisher(Deps deps) : deps_(std::move(deps)) {}

  std::vector<BrokerMessage> changes(bool everything) override;
  BrokerMessage presence(bool online) override;

 private:
  using Messages = std::vector<BrokerMessage>;
  void put(Messages& out, const std::string& topic, std::string_view payload, bool at_least_once);
  void alarms(Messages& out);
  bool is_due(bool revision_came, const std::optional<std::uint64_t>& stored) const;
  void anchors(Messages& out);
  void missions(Messages& out);
  void estimates(Messages& out);
  void name_sites();
  void clear_renamed(Messages& out);
  std::string level(const std::optional<SiteId>& site);
  /// PREFIX/SITE where this mission is the site's newest; none: it is an older one.
  std::optional<std::string> place(const MissionId& mission);
  void forget(Messages& out, const std::string& topic, bool at_least_once);

  Deps deps_;
  std::map<std::string, std::string, std::less<>> sent_;  ///< payload of each topic
  std::map<SiteId, std::string> levels_;
  std::map<MissionId, std::optional<SiteId>> site_of_;
  std::map<std::string, MissionId> newest_;  ///< of each PREFIX/SITE; survives a connection
  std::vector<std::string> superseded_;      ///< PREFIX/SITE with a new mission: its estimates go
  std::vector<std::string> renamed_;         ///< PREFIX/SITE of before, of a site with another name now
  // What the broker keeps of us, over connections.
  std::set<std::string> anchors_;                           ///< topics
  std::map<std::string, std::set<std::string>> estimates_;  ///< topics by PREFIX/SITE
  std::uint64_t alarms_seq_{0}, missions_seq_{0}, estimates_seq_{0}, revisions_seq_{0};
  std::optional<SteadyTime> refreshed_{};
  std::optional<std::uint64_t> stored_{};  ///< RevisionStore::changes() before the anchors were read
  double rest_s_{0};                       ///< before they are read again for less than a revision
};

}  // namespace anchord::api
