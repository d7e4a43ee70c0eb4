#include "api/calibration/datum_gate.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/calibration/routes.hpp"
#include "api/kit/support.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {
namespace {

bool says_datum_change(const Calibration& calibration) {
  const auto settings = nlohmann::json::parse(calibration.settings.text, nullptr, false);
  return settings.is_object() && settings.contains("datum_change");
}

bool is_datum_change(CalibrationApi& s, const CalibrationId& id) {
  {
    const auto known = s.datum_changes->lock();
    if (const auto at = known->find(id); at != known->end()) return at->second;
  }
  const auto calibration = s.calibration_store.calibration(id);
  if (!calibration) return false;  // of another site than who asks may see
  const bool is = says_datum_change(calibration.value());
  auto known = s.datum_changes->lock();
  known->emplace(id, is);
  return is;
}

std::optional<SiteId> site_of(CalibrationApi& s, const MissionId& id) {
  const auto mission = s.mission_store.mission(id);
  return mission ? mission.value().site : std::nullopt;
}

bool is_of(CalibrationApi& s, const Calibration& change, const SiteId& site) {
  return std::ranges::any_of(change.missions, [&](const MissionId& id) { return site_of(s, id) == site; });
}

/// The newest change of the datum of this site.
std::optional<Revision> newest_change(CalibrationApi& s, const SiteId& site) {
  constexpr std::size_t k_page = 200;
  for (std::uint64_t before = 0;;) {
    const auto page = value_or_problem(s.revisions.revisions(k_page, before));
    for (const Revision& revision : page) {
      if (!is_datum_change(s, revision.calibration)) continue;
      const auto change = s.calibration_store.calibration(revision.calibration);
      if (change && is_of(s, change.value(), site)) return revision;
    }
    if (page.size() < k_page) return std::nullopt;
    before = page.back().number;
  }
}

}  // namespace

std::optional<Gate> datum_gate(CalibrationApi& s, const Calibration& calibration) {
  if (calibration.missions.empty() || calibration.frame == TrackFrame::local) return std::nullopt;
  if (says_datum_change(calibration)) return std::nullopt;
  const auto site = site_of(s, calibration.missions.front());
  if (!site) return std::nullopt;
  const auto change = newest_change(s, *site);
  if (!change) return std::nullopt;
  Gate gate;
  gate.name = "datum";
  gate.value = 0;
  for (const MissionId& id : calibration.missions) {
    const auto mission = s.mission_store.mission(id);
    if (mission && mission.value().created < change->published) gate.value = *gate.value + 1;
  }
  gate.passed = *gate.value == 0;
  if (!gate.passed)
    gate.why = "flown before revision " + std::to_string(change->number) +
               ", which changed the datum of the site: these coordinates are the former ones; fly again, or "
               "change the datum of what this publishes";
  return gate;
}

}  // namespace anchord::api
