#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "api/anchors/site_json.hpp"
#include "api/calibration/calibration_json.hpp"
#include "api/calibration/datum_change.hpp"
#include "api/calibration/revision_news.hpp"
#include "api/calibration/routes.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

/// The newest published positions of a site's anchors: those that say so, and those of flights there whose
/// anchor names no site.
std::vector<PublishedPosition> positions_of(CalibrationApi& s, const SiteId& site,
                                            std::set<MissionId>& missions) {
  std::vector<PublishedPosition> out;
  for (auto& position : value_or_problem(s.revisions.published(std::nullopt))) {
    const auto anchor = s.anchors.anchor(position.estimate.anchor);
    if (anchor && anchor.value().site && anchor.value().site != site) continue;
    const auto calibration = value_or_problem(s.calibration_store.calibration(position.calibration));
    const bool flown_here = std::ranges::any_of(calibration.missions, [&](const MissionId& id) {
      const auto mission = s.mission_store.mission(id);
      return mission && mission.value().site == site;
    });
    if (!(anchor && anchor.value().site) && !flown_here) continue;
    missions.insert(calibration.missions.begin(), calibration.missions.end());
    out.push_back(std::move(position));
  }
  return out;
}

DatumChange change_of(const DatumRequest& wanted, const std::vector<PublishedPosition>& positions,
                      const Wgs84& origin) {
  if (wanted.helmert) return *wanted.helmert;
  if (wanted.shift_enu_m) return datum_change_at(origin, *wanted.shift_enu_m);
  const DatumRequest::Mark& mark = *wanted.mark;
  if (mark.measured) return datum_change_between(*mark.measured, mark.known);
  for (const auto& position : positions) {
    if (position.estimate.anchor == *mark.anchor)
      return datum_change_between(*position.estimate.best->wgs84, mark.known);
  }
  throw_problem(422, "validation", "the mark is not a published anchor of this site",
                {{"/mark/anchor", "unknown_anchor",
                  to_string(*mark.anchor) + " has no published position at this site"}});
}

struct Changed {
  Calibration calibration;
  std::vector<NetworkId> anchors;
  std::vector<Override> overrides;
  Ordered moved = Ordered::array();
};

Changed changed(CalibrationApi& s, const Request& request, const DatumRequest& wanted, const Site& site) {
  std::set<MissionId> missions;
  const auto positions = positions_of(s, site.id, missions);
  if (positions.empty())
    throw_problem(409, "conflict", "no anchor of this site is published: there is nothing to change");
  for (const auto& position : positions) {
    if (position.frame == TrackFrame::local || !position.estimate.best || !position.estimate.best->wgs84)
      throw_problem(
          409, "conflict",
          to_string(position.estimate.anchor) + " is published in a local frame, which has no datum");
  }
  const Wgs84 origin =
      site.origin.value_or(positions.front().origin.value_or(*positions.front().estimate.best->wgs84));
  const DatumChange change = change_of(wanted, positions, origin);
  Changed out;
  out.calibration.id.uuid = make_uuid_v7(s.clock.now());
  out.calibration.missions.assign(missions.begin(), missions.end());
  out.calibration.origin = origin;
  out.calibration.created = s.clock.now();
  out.calibration.settings = {to_wire(Ordered{{"datum_change", nlohmann::json::parse(request.body)}})};
  out.calibration.provenance = {to_wire(Ordered{{"base", site_base_json(site)}})};
  for (const auto& position : positions) {
    const Estimate now = in_datum(position, change, wanted.sigma_m, origin);
    const Eigen::Vector3d by_m = EnuFrame(*position.estimate.best->wgs84).enu_from_wgs84(*now.best->wgs84).m;
    out.moved.push_back(
        {{"network_id", to_string(now.anchor)},
         {"moved_enu_m", {by_m.x(), by_m.y(), by_m.z()}},
         {"geometry",
          {{"type", "Point"},
           {"coordinates",
            {now.best->wgs84->lon_deg, now.best->wgs84->lat_deg, now.best->wgs84->height_m}}}}});
    out.anchors.push_back(now.anchor);
    if (position.overridden) out.overrides.push_back(*position.overridden);
    out.calibration.anchors.push_back(now);
  }
  return out;
}

Response change_datum(CalibrationApi& s, const Request& request) {
  check_query(request, {"dry_run"});
  const Site site = value_or_problem(s.sites.site(path_id<SiteId>(request)));
  std::vector<FieldError> errors;
  const DatumRequest wanted = read_datum_request(json_body(request), errors);
  refuse_if_any(errors);
  const auto newest = value_or_problem(s.revisions.revisions(1, 0));
  const std::uint64_t decided_on = newest.empty() ? 0 : newest.front().number;
  Changed change = changed(s, request, wanted, site);
  Ordered answer{{"from_revision", decided_on}};
  if (query_flag(request, "dry_run")) {
    answer["revision"] = answer["calibration"] = nullptr;
    answer["anchors"] = std::move(change.moved);
    return json_response(200, answer);
  }
  // Audited before it happens, as every publication.
  s.audit(request, "site.datum " + to_string(site.id) + " note: " + wanted.note);
  value_or_problem(s.calibration_store.insert(change.calibration));
  const auto published =
      s.revisions.publish(change.calibration.id, change.anchors, request.principal.token_id, wanted.note,
                          s.clock.now(), change.overrides, decided_on);
  if (!published) {
    (void)s.calibration_store.remove(change.calibration.id);  // nothing half-applied
    throw ProblemException{problem_of(published.error())};
  }
  announce_revision(s, published.value(), change.anchors.size(), change.overrides.size());
  answer["revision"] = published.value().number;
  answer["calibration"] = to_string(change.calibration.id);
  answer["anchors"] = std::move(change.moved);
  Response response = json_response(201, answer);
  response.header("Location", "/api/v1/anchors?revision=" + std::to_string(published.value().number));
  return response;
}

}  // namespace

void add_datum_routes(Router& router, CalibrationApi& s) {
  router.add({Method::post, "/api/v1/sites/{id}/datum", Access::any_of({Role::engineer}),
              [&s](const Request& request) { return change_datum(s, request); }});
}

}  // namespace anchord::api
