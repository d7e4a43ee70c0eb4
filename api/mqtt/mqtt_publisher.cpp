#include "api/mqtt/mqtt_publisher.hpp"

#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "api/anchors/anchor_json.hpp"
#include "api/mqtt/topic_name.hpp"
#include "api/stream/hub.hpp"
#include "core/base/guard.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

/// How old names, sites of anchors and what later flights said of them may be.
constexpr double k_refresh_s = 30, k_refresh_shared_s = 5;
constexpr double k_rest_times = 20;  ///< as long as reading all anchors took
constexpr std::size_t k_most_sites = 10'000;
constexpr std::size_t k_id_length = 36, k_id_end = 12;

std::optional<MissionId> mission_of(const std::string& key) {
  const auto id = parse_uuid(std::string_view(key).substr(0, k_id_length));
  return id ? std::optional(MissionId{id.value()}) : std::nullopt;
}

}  // namespace

BrokerMessage MqttPublisher::presence(bool online) {
  return {deps_.prefix + "/_server/status",
          to_wire(Ordered{{"state", online ? "online" : "offline"}, {"version", deps_.version}}), true};
}

std::vector<BrokerMessage> MqttPublisher::changes(bool everything) {
  Messages out;
  if (everything) {
    sent_.clear();
    alarms_seq_ = missions_seq_ = estimates_seq_ = revisions_seq_ = 0;
    refreshed_.reset();
  }
  // What fails in one must not keep the others back, nor end the connection.
  (void)guarded("mqtt alarms", [&] { alarms(out); });
  (void)guarded("mqtt anchors", [&] { anchors(out); });
  clear_renamed(out);
  (void)guarded("mqtt missions", [&] { missions(out); });
  (void)guarded("mqtt estimates", [&] { estimates(out); });
  return out;
}

void MqttPublisher::put(Messages& out, const std::string& topic, std::string_view payload,
                        bool at_least_once) {
  auto& before = sent_[topic];
  if (before == payload) return;
  before = payload;
  out.push_back({topic, before, at_least_once});
}

void MqttPublisher::alarms(Messages& out) {
  const auto newest = deps_.hub.newest(Topic::alarms, alarms_seq_);
  if (!newest) return;
  for (const auto& element : newest->elements)
    put(out, deps_.prefix + "/_server/alarms", *element.json, true);
  alarms_seq_ = newest->seq;
}

void MqttPublisher::name_sites() {
  const auto sites = deps_.sites.sites(k_most_sites, {}, {});
  if (!sites) return;
  const auto before = std::exchange(levels_, {});
  std::set<std::string> taken;
  for (const auto& site : sites.value()) {
    std::string name = topic_level(site.name);
    if (!taken.insert(name).second) name += '~' + to_string(site.id).substr(k_id_length - k_id_end);
    levels_[site.id] = std::move(name);
  }
  for (const auto& [site, name] : before) {
    const auto now = levels_.find(site);
    if (now == levels_.end() || now->second != name) renamed_.push_back(deps_.prefix + '/' + name);
  }
}

/// Of a site that has another name now: what was published of its flight goes, and comes anew.
void MqttPublisher::clear_renamed(Messages& out) {
  for (const auto& where : std::exchange(renamed_, {})) {
    if (newest_.erase(where) > 0) forget(out, where + "/mission", false);
    for (const auto& topic : std::exchange(estimates_[where], {})) forget(out, topic, false);
    missions_seq_ = estimates_seq_ = 0;
  }
}

std::string MqttPublisher::level(const std::optional<SiteId>& site) {
  if (!site) return "_none";
  if (!levels_.contains(*site)) name_sites();
  const auto known = levels_.find(*site);
  return known == levels_.end() ? "_none" : known->second;
}

void MqttPublisher::forget(Messages& out, const std::string& topic, bool at_least_once) {
  out.push_back({topic, "", at_least_once});
  sent_.erase(topic);
}

/// When all published anchors are read again: a revision came, or what is stored of them changed (names,
/// sites, retirements). Where others write too that cannot be told, nor can what the watch of contradictions
/// finds: after some seconds.
bool MqttPublisher::is_due(bool revision_came, const std::optional<std::uint64_t>& stored) const {
  if (revision_came || !refreshed_) return true;
  const double since_s = seconds_between(*refreshed_, deps_.steady.now());
  if (stored && stored != stored_ && since_s >= rest_s_) return true;
  return since_s >= std::max(rest_s_, stored ? k_refresh_s : k_refresh_shared_s);
}

void MqttPublisher::anchors(Messages& out) {
  const auto came = deps_.hub.newest(Topic::revisions, revisions_seq_);
  const auto stored = deps_.revisions.changes();
  if (!is_due(came.has_value(), stored)) return;
  const SteadyTime began = deps_.steady.now();
  refreshed_ = began;
  stored_ = stored;
  if (came) revisions_seq_ = came->seq;
  name_sites();
  site_of_.clear();
  const auto newest = deps_.revisions.revisions(1, 0);
  if (!newest || newest.value().empty()) return;
  std::set<std::string> there;
  for (const auto& feature : deps_.published()) {
    auto topic =
        deps_.prefix + '/' + level(feature.anchor.site) + "/anchors/" + to_string(feature.anchor.network_id);
    put(out, topic, to_wire(anchor_feature_json(feature)), true);
    there.insert(std::move(topic));
  }
  rest_s_ = k_rest_times * seconds_between(began, deps_.steady.now());
  const auto& revision = newest.value().front();
  put(out, deps_.prefix + "/_server/revision",
      to_wire(Ordered{{"revision", revision.number},
                      {"t_us", revision.published.us()},
                      {"calibration", to_string(revision.calibration)},
                      {"anchors", there.size()}}),
      true);
  for (const auto& topic : anchors_) {
    if (!there.contains(topic)) forget(out, topic, true);
  }
  anchors_ = std::move(there);
}

std::optional<std::string> MqttPublisher::place(const MissionId& mission) {
  auto known = site_of_.find(mission);
  if (known == site_of_.end()) {
    const auto stored = deps_.missions.mission(mission);
    if (!stored) return std::nullopt;  // deleted, or its row follows
    known = site_of_.emplace(mission, stored.value().site).first;
  }
  std::string out = deps_.prefix + '/' + level(known->second);
  const auto [newest, first] = newest_.try_emplace(out, mission);
  if (mission < newest->second) return std::nullopt;
  if (newest->second < mission) {
    newest->second = mission;
    superseded_.push_back(out);
  }
  return out;
}

void MqttPublisher::missions(Messages& out) {
  const auto newest = deps_.hub.newest(Topic::mission_state, missions_seq_);
  if (!newest) return;
  std::map<std::string, std::string_view> of_site;
  // Keys are in the order of ids, so that the newest of a site comes last.
  for (const auto& element : newest->elements) {
    const auto mission = mission_of(element.key);
    if (!mission) continue;
    if (const auto where = place(*mission)) of_site[*where] = *element.json;
  }
  for (const auto& [where, json] : of_site) put(out, where + "/mission", json, false);
  missions_seq_ = newest->seq;
}

void MqttPublisher::estimates(Messages& out) {
  const auto newest = deps_.hub.newest(Topic::anchors_estimates, estimates_seq_);
  std::map<std::string, std::map<std::string, std::string_view>> of_site;
  if (newest) {
    std::optional<std::string> where;
    std::optional<MissionId> mission;
    for (const auto& element : newest->elements) {
      const auto one = mission_of(element.key);
      if (!one || !element.anchor) continue;
      if (!mission || *mission != *one) {
        mission = one;
        where = place(*one);
        if (where) of_site[*where].clear();
      }
      if (where) of_site[*where][to_string(*element.anchor)] = *element.json;
    }
    estimates_seq_ = newest->seq;
  }
  std::map<std::string, std::set<std::string>> before;
  for (const auto& where : std::exchange(superseded_, {}))
    before[where] = std::exchange(estimates_[where], {});
  for (const auto& [where, all] : of_site) {
    for (const auto& [anchor, json] : all) {
      const std::string topic = where + "/estimates/" + anchor;
      put(out, topic, json, false);
      estimates_[where].insert(topic);
    }
  }
  for (const auto& [where, topics] : before) {
    for (const auto& topic : topics) {
      if (!estimates_[where].contains(topic)) forget(out, topic, false);
    }
  }
}

}  // namespace anchord::api
