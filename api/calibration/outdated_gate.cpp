#include "api/calibration/outdated_gate.hpp"

#include <nlohmann/json.hpp>

#include "api/calibration/calibration_record.hpp"
#include "api/calibration/routes.hpp"
#include "api/kit/support.hpp"
#include "core/base/sha256.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

/// What has changed of a flight since `told` was written of it; empty: nothing.
std::string changed(CalibrationApi& s, const Mission& mission, const Json& told) {
  std::string what;
  if (const auto declared = told.find("declared_sha256");
      declared != told.end() && *declared != declared_sha256(mission))
    what = "track point, lever arms or kit";
  if (const auto then = told.find("exclusions"); then != told.end() && then->is_object()) {
    const Json now = Json::parse(exclusions_json(value_or_problem(s.exclusions.exclusions(mission.id))));
    if (then->value("sha256", Json()) != now["sha256"])
      what += std::string(what.empty() ? "" : " and ") + "exclusions";
  }
  return what;
}

}  // namespace

std::string declared_sha256(const Mission& mission) {
  Sha256 digest;
  digest.add(mission.kit + '\n' + std::string(k_point_words.word(mission.point)) + '\n');
  for (const TagAntenna& one : mission.tags) {
    digest.add(to_string(one.tag) + ' ' + std::to_string(one.antenna) + '\n');
    for (const double arm_m : one.lever_arm_body_m) digest.add(arm_m);
  }
  if (mission.lever_arm_sigma_m) digest.add(*mission.lever_arm_sigma_m);
  return digest.hex();
}

std::optional<Gate> outdated_gate(CalibrationApi& s, const Calibration& calibration) {
  const auto provenance = Json::parse(calibration.provenance.text, nullptr, false);
  if (!provenance.is_object() || !provenance.contains("flights")) return std::nullopt;
  Gate gate{"outdated", 0.0, 0.0, false, ""};
  for (const Json& told : provenance["flights"]) {
    const auto id = parse_uuid(told.value("mission", ""));
    const auto mission = id ? s.mission_store.mission(MissionId{id.value()}) : Result<Mission>(id.error());
    if (!mission) continue;  // deleted, or of another site than who asks may see
    const std::string what = changed(s, mission.value(), told);
    if (what.empty()) continue;
    gate.value = *gate.value + 1;
    gate.why += (gate.why.empty() ? "" : "; ") + what + " of flight \"" + mission.value().name + "\"";
  }
  if (*gate.value == 0) return std::nullopt;
  gate.why += ": changed since it was solved; solve again";
  return gate;
}

}  // namespace anchord::api
