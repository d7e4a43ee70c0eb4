#include "api/anchors/contradiction_watch.hpp"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <tuple>

#include "api/admin/event_log.hpp"
#include "core/geo/enu.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr std::size_t k_calibrations_read = 200;         // the newest; older ones were answered long ago
constexpr std::size_t k_named = 6;                       // in the text of the alarm
const UtcTime k_stamped{946'684'800LL * 1'000'000'000};  // 2000-01-01; folders without an epoch begin in 1970

/// An answer about one anchor with what its numbers are numbers of.
struct Answer {
  const Estimate* estimate{nullptr};
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Wgs84> origin{};
  std::optional<SiteId> site{};
  bool plane{false};
};

bool holds_height(const std::string& settings) {
  const auto j = nlohmann::json::parse(settings, nullptr, false);
  return j.is_object() && j.contains("dims") && j["dims"] == 2;
}

std::optional<SiteId> site_of(MissionStore& missions, const std::vector<MissionId>& of) {
  if (of.empty()) return std::nullopt;
  const auto mission = missions.mission(of.front());
  return mission ? mission.value().site : std::nullopt;
}

/// In ENU of `common`, or its own local metres.
KnownPlace placed_in(const EnuFrame& common, const Answer& answer) {
  const Hypothesis& best = *answer.estimate->best;
  if (answer.frame == TrackFrame::local || !answer.origin) return {best.position.m, best.covariance_m2};
  const EnuFrame own(*answer.origin);
  return {common.enu_from_wgs84(own.wgs84_from_enu(best.position)).m,
          own.covariance_in(common, best.covariance_m2)};
}

bool comparable(const Answer& a, const Answer& b) {
  if (a.frame != b.frame) return false;
  return a.frame == TrackFrame::wgs84 ? a.origin && b.origin : a.site == b.site;
}

/// When an answer was measured; for flights without dates, when it was computed.
UtcTime age(const Estimate& estimate, const Calibration& of) {
  return estimate.time >= k_stamped ? estimate.time : of.created;
}

std::string text_of(const Contradiction& c, UtcTime measured) {
  char text[320];
  int used = std::snprintf(text, sizeof text,
                           "%s: the flight of %s found it %.2f m from its published position (%.2f m "
                           "horizontally): chi2 %.4g, limit %.1f",
                           to_string(c.anchor).c_str(), to_rfc3339(measured).substr(0, 10).c_str(),
                           c.plane ? c.delta_m.head<2>().norm() : c.delta_m.norm(),
                           c.delta_m.head<2>().norm(), c.chi2, c.limit);
  if (c.exchange && used > 0 && static_cast<std::size_t>(used) < sizeof text) {
    const auto [low, high] = std::minmax(c.anchor, c.exchange->with);
    std::snprintf(text + used, sizeof text - static_cast<std::size_t>(used),
                  "; %s and %s look exchanged: exchanging them lowers chi2 from %.4g to %.4g",
                  to_string(low).c_str(), to_string(high).c_str(), c.exchange->chi2,
                  c.exchange->chi2_exchanged);
  }
  return text;
}

}  // namespace

nlohmann::ordered_json contradiction_json(const ContradictedAnchor& anchor) {
  const auto metres = [](double v) { return std::round(v * 1e4) / 1e4; };
  const Contradiction& c = anchor.what;
  Ordered missions = Ordered::array();
  for (const auto& id : anchor.missions) missions.push_back(to_string(id));
  Ordered exchanged = nullptr;
  if (c.exchange) {
    exchanged = {{"network_id", to_string(c.exchange->with)},
                 {"chi2", c.exchange->chi2},
                 {"chi2_exchanged", c.exchange->chi2_exchanged}};
  }
  return {{"calibration", to_string(anchor.calibration)},
          {"missions", std::move(missions)},
          {"measured_at", to_rfc3339(anchor.measured)},
          {"delta_enu_m", {metres(c.delta_m.x()), metres(c.delta_m.y()), metres(c.delta_m.z())}},
          {"distance_m", metres(c.plane ? c.delta_m.head<2>().norm() : c.delta_m.norm())},
          {"horizontal_m", metres(c.delta_m.head<2>().norm())},
          {"chi2", c.chi2},
          {"chi2_limit", c.limit},
          {"p_value", c.p_value},
          {"exchanged_with", std::move(exchanged)},
          {"text", anchor.text}};
}

void ContradictionWatch::changed() {
  auto newest = newest_.lock();
  ++newest->change;
}

std::optional<std::uint64_t> ContradictionWatch::settled() const {
  const auto newest = newest_.lock();
  if (newest->compared != newest->change) return std::nullopt;
  return newest->change;
}

std::shared_ptr<const ContradictionWatch::Standing> ContradictionWatch::standing() {
  const std::scoped_lock one(comparing_);
  std::uint64_t change = 0;
  {
    const auto newest = newest_.lock();
    if (newest->compared == newest->change) return newest->standing;
    change = newest->change;
  }
  auto found = compare();
  std::vector<const ContradictedAnchor*> news;
  std::shared_ptr<const Standing> now;
  {
    auto newest = newest_.lock();
    if (!found) return newest->standing;
    now = std::make_shared<Standing>(std::move(found).value());
    for (const auto& [id, anchor] : *now) {
      const auto before = newest->standing->find(id);
      if (newest->known && (before == newest->standing->end() || before->second.text != anchor.text))
        news.push_back(&anchor);
    }
    newest->standing = now;
    newest->compared = change;
    newest->known = true;
  }
  for (const auto* anchor : news) {
    const auto& missions = anchor->missions;
    deps_.events.add(EventLevel::warning, "anchor.contradicted", anchor->text,
                     missions.empty() ? std::nullopt : std::optional(missions.back()));
  }
  return now;
}

std::vector<AlarmCondition> ContradictionWatch::alarms() const {
  const auto now = [&] {
    const auto newest = newest_.lock();
    return newest->standing;
  }();
  if (now->empty()) return {};
  std::string text;
  std::size_t n = 0;
  for (const auto& [id, anchor] : *now) {
    if (n++ < k_named) text += (text.empty() ? "" : ". ") + anchor.text;
  }
  if (n > k_named) text += ". And " + std::to_string(n - k_named) + " more: see the anchors' status";
  return {{"anchor.contradicted", AlarmPriority::warning, std::move(text), std::nullopt, true}};
}

Result<ContradictionWatch::Standing> ContradictionWatch::compare() {
  BOOST_OUTCOME_TRY(const auto published, deps_.revisions.published(std::nullopt));
  Standing out;
  if (published.empty()) return out;
  std::map<CalibrationId, Calibration> known;
  std::map<CalibrationId, std::optional<SiteId>> sites;
  const auto answer_of = [&](const Calibration& c, const Estimate& e) {
    const auto [site, fresh] = sites.try_emplace(c.id);
    if (fresh && c.frame == TrackFrame::local) site->second = site_of(deps_.missions, c.missions);
    return Answer{&e, c.frame, c.origin, site->second, holds_height(c.settings.text)};
  };
  std::map<NetworkId, const PublishedPosition*> wanted;
  for (const auto& position : published) {
    const auto anchor = deps_.anchors.anchor(position.estimate.anchor);
    if (!position.estimate.best || (anchor && anchor.value().retired)) continue;
    wanted[position.estimate.anchor] = &position;
    if (known.count(position.calibration) > 0) continue;
    BOOST_OUTCOME_TRY(auto calibration, deps_.calibrations.calibration(position.calibration));
    known.emplace(position.calibration, std::move(calibration));
  }
  BOOST_OUTCOME_TRY(const auto newest, deps_.calibrations.calibrations(k_calibrations_read, std::nullopt));
  struct Later {
    const Calibration* of{nullptr};
    const Estimate* estimate{nullptr};
  };
  std::map<NetworkId, Later> later;
  for (const auto& calibration : newest) {
    for (const auto& estimate : calibration.anchors) {
      const auto at = wanted.find(estimate.anchor);
      if (at == wanted.end() || !estimate.best || estimate.verdict != Verdict::ok) continue;
      const Calibration& before = known.at(at->second->calibration);
      // The same measurements solved again are no later flight.
      const std::set<MissionId> flown(before.missions.begin(), before.missions.end());
      const bool same = std::all_of(calibration.missions.begin(), calibration.missions.end(),
                                    [&](const MissionId& id) { return flown.count(id) > 0; });
      if (same || age(estimate, calibration) <= age(at->second->estimate, before)) continue;
      if (!comparable(answer_of(calibration, estimate), answer_of(before, at->second->estimate))) continue;
      Later& best = later[estimate.anchor];
      const auto key = [](const Later& l) { return std::tuple(age(*l.estimate, *l.of), l.of->created); };
      const Later candidate{&calibration, &estimate};
      if (best.of == nullptr || key(candidate) > key(best)) best = candidate;
    }
  }
  const auto first = std::find_if(published.begin(), published.end(), [](const auto& p) { return p.origin; });
  const EnuFrame common(first == published.end() ? Wgs84{} : *first->origin);
  std::vector<PlaceTwice> pairs;
  for (const auto& [id, found] : later) {
    const PublishedPosition& position = *wanted.at(id);
    const Answer now = answer_of(*found.of, *found.estimate);
    const Answer before = answer_of(known.at(position.calibration), position.estimate);
    pairs.push_back({id, placed_in(common, before), placed_in(common, now), found.estimate->acceptable(),
                     now.plane || before.plane});
  }
  for (const auto& what : contradictions(pairs)) {
    const Later& found = later.at(what.anchor);
    ContradictedAnchor anchor{what, found.of->id, found.of->missions, age(*found.estimate, *found.of), {}};
    anchor.text = text_of(what, anchor.measured);
    out.emplace(what.anchor, std::move(anchor));
  }
  return out;
}

}  // namespace anchord::api
