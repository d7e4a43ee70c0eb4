#include "api/calibration/calibration_json.hpp"

#include <nlohmann/json.hpp>

#include "api/anchors/anchor_json.hpp"
#include "api/anchors/site_json.hpp"
#include "api/wire/budget_json.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

Ordered calibration_json(const Calibration& calibration, const AnchorGoals* goals) {
  Ordered missions = Ordered::array();
  for (const auto& id : calibration.missions) missions.push_back(to_string(id));
  Ordered out{{"id", to_string(calibration.id)},
              {"created_at", to_rfc3339(calibration.created)},
              {"missions", std::move(missions)},
              {"frame", k_frame_words.word(calibration.frame)},
              {"origin", wgs84_json(calibration.origin)}};
  auto settings = Ordered::parse(calibration.settings.text, nullptr, false);
  out["settings"] = settings.is_discarded() ? Ordered::object() : std::move(settings);
  auto provenance = Ordered::parse(calibration.provenance.text, nullptr, false);
  out["provenance"] = provenance.is_object() ? std::move(provenance) : Ordered::object();
  if (goals == nullptr) return out;
  const auto flown = goals->flown(calibration.missions);
  Ordered anchors = Ordered::array();
  for (const auto& estimate : calibration.anchors) {
    anchors.push_back(estimate_result_json(estimate, calibration.frame, std::nullopt, std::nullopt,
                                           globe_accuracy(out["provenance"], estimate.anchor)));
    // Told in a local frame too, where the calibration asked for one.
    const auto local = Ordered::json_pointer("/frame/anchors/" + to_string(estimate.anchor));
    if (out["provenance"].contains(local)) anchors.back()["local_m"] = out["provenance"][local];
    anchors.back()["goal"] = anchor_goal_json(goals->of(estimate.anchor, flown), estimate);
    anchors.back()["budget"] = kept_budget(out["provenance"], estimate.anchor);
  }
  out["anchors"] = std::move(anchors);
  out["provenance"].erase("budgets");  // each is with its anchor
  return out;
}

Ordered revision_json(const Revision& revision) {
  return {{"revision", revision.number},
          {"t_us", revision.published.us()},
          {"published_at", to_rfc3339(revision.published)},
          {"calibration", to_string(revision.calibration)},
          {"by", revision.by},
          {"note", revision.note}};
}

}  // namespace anchord::api
