#include "api/anchors/anchor_selection.hpp"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "api/anchors/published_features.hpp"
#include "api/anchors/routes.hpp"
#include "api/kit/query_site.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/missions/mission_service.hpp"
#include "api/wire/live_writer.hpp"
#include "core/types/lon_lat_box.hpp"

namespace anchord::api {

namespace {

/// Running estimates; of an anchor that several missions hear the newest.
std::vector<AnchorFeature> live(AnchorApi& s, const std::optional<MissionId>& mission) {
  if (mission) value_or_problem(s.missions.mission(*mission));
  FeatureLookup lookup(s);
  std::map<NetworkId, AnchorFeature> newest;
  for (const auto& view : s.missions.live(mission)) {
    const auto flown = s.goals.flown({view.mission.id});
    for (const auto& estimate : view.estimates) {
      auto& feature = newest[estimate.anchor];
      if (feature.estimate && estimate.time < feature.estimate->time) continue;
      feature.estimate = estimate;
      feature.goal = s.goals.of(estimate.anchor, flown);
      feature.frame = view.mission.frame;
      feature.missions = {view.mission.id};
      feature.calibrated = estimate.time;
      feature.status = flight::anchor_status(estimate);
    }
  }
  std::vector<AnchorFeature> out;
  for (auto& [id, feature] : newest) {
    feature.anchor = anchor_as_stored(s, id);
    feature.site = lookup.site(feature.anchor.site);
    out.push_back(std::move(feature));
  }
  return out;
}

std::optional<LonLatBox> query_box(const Request& request) {
  const auto text = request.query_value("bbox");
  if (!text) return std::nullopt;
  nlohmann::json numbers;
  if (parse_json('[' + *text + ']', numbers) || numbers.size() != 4 ||
      !std::all_of(numbers.begin(), numbers.end(), [](const auto& n) { return n.is_number(); })) {
    throw_problem(422, "validation", "bbox must be west,south,east,north in degrees",
                  {{"/bbox", "bad_value", "must be four numbers"}});
  }
  const LonLatBox box = lon_lat_box(numbers[0], numbers[1], numbers[2], numbers[3]);
  if (box.south > box.north)
    throw_problem(422, "validation", "bbox must be west,south,east,north in degrees",
                  {{"/bbox", "bad_value", "has its south above its north"}});
  return box;
}

}  // namespace

std::vector<AnchorFeature> selected_anchors(AnchorApi& s, const Request& request, std::uint64_t& number) {
  const auto view = request.query_value("view").value_or("published");
  std::optional<std::uint64_t> revision;
  if (const auto text = request.query_value("revision")) {
    nlohmann::json value;
    if (parse_json(*text, value) || !value.is_number_unsigned())
      throw_problem(422, "validation", "revision must be a number",
                    {{"/revision", "wrong_type", "must be a number"}});
    revision = value.get<std::uint64_t>();
    if (*revision == 0 || *revision > newest_revision(s))
      throw_problem(404, "not-found", "there is no revision " + *text);
  }
  if (view != "published" && view != "live")
    throw_problem(422, "validation", "view must be published or live",
                  {{"/view", "unknown_value", "must be published or live"}});
  auto all = view == "live" ? live(s, query_mission(request)) : published_features(s, revision, number);
  const auto box = query_box(request);
  const auto site = query_site(s.sites, request);
  std::erase_if(all, [&](const AnchorFeature& feature) {
    if (site && feature.anchor.site != site) return true;
    if (!box) return false;
    if (!feature.estimate || !feature.estimate->best || !feature.estimate->best->wgs84) return true;
    return !box->holds(*feature.estimate->best->wgs84);
  });
  return all;
}

}  // namespace anchord::api
