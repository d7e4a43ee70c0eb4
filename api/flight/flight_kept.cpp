// What of a flight is kept, so that a server that was killed goes on with it.
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/flight/flight_state.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/kit/late_writer.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {
namespace {

constexpr std::uint64_t k_aborted = 1'000'000;  // beyond any number of transitions

/// System 0 where it is not said: whoever is heard first.
DroneIdentity aircraft_of(const nlohmann::json& stored) {
  if (!stored.is_object()) return {};
  return {stored.value("peer", ""), stored.value("system", 0), stored.value("component", 0)};
}

nlohmann::ordered_json document_of(const flight::ActiveFlight& f) {
  const auto& o = f.frame.origin();
  const auto& a = f.aircraft;
  return {{"plan", nlohmann::json::parse(stored(f.plan).document.text)},
          {"plan_id", to_string(f.plan.id)},
          {"plan_revision", f.plan.version},
          {"manual", f.manual},
          {"aircraft", {{"peer", a.peer}, {"system", a.system}, {"component", a.component}}},
          {"origin", {o.lat_deg, o.lon_deg, o.height_m}},
          {"home_m", {f.home_m.x(), f.home_m.y(), f.home_m.z()}},
          {"state", stored_state(f.control.engine().state())},
          {"clues", stored_priors(f.priors())}};
}

/// Nothing where the document is of another shape.
std::optional<flight::KeptFlight> kept_flight(const MissionId& mission, const nlohmann::json& j) {
  const bool whole = j.is_object() && j.contains("plan") && j.contains("state") && j.contains("origin") &&
                     j.contains("home_m") && j["origin"].size() == 3 && j["home_m"].size() == 3;
  if (!whole) return std::nullopt;
  std::vector<FieldError> errors;
  const auto state = state_of(j["state"]);
  flight::KeptFlight out;
  out.plan = read_plan(j["plan"], errors);
  if (!state || !errors.empty()) return std::nullopt;
  out.mission = mission;
  out.state = *state;
  if (const auto id = parse_uuid(j.value("plan_id", ""))) out.plan.id = PlanId{id.value()};
  out.plan.version = j.value("plan_revision", 1ULL);
  out.plan.origin = Wgs84{j["origin"][0], j["origin"][1], j["origin"][2]};
  out.home_m = {j["home_m"][0].get<double>(), j["home_m"][1].get<double>(), j["home_m"][2].get<double>()};
  out.manual = j.value("manual", false);
  out.aircraft = aircraft_of(j.value("aircraft", nlohmann::json()));
  out.priors = priors_of(j.value("clues", nlohmann::json()));
  return out;
}

}  // namespace

bool FlightService::State::to_keep(Work& w, std::string& text) {
  const auto& f = w.operations.flight();
  if (!f) return false;
  const auto n = f->control.engine().state().n_transitions + (f->aborted.empty() ? 0 : k_aborted);
  if (n == w.last.kept) return false;
  w.last.kept = n;
  text.clear();
  if (f->flying()) {
    text = to_wire(document_of(*f));
  } else if (const auto found = stored_priors(f->priors()); !found.empty()) {
    // What turns and height searches found outlives the flight: every calibration of it asks for it.
    text = to_wire(nlohmann::ordered_json{{"landed", true}, {"clues", found}});
  }
  return true;
}

/// A disk that is slow or full makes no flight wait: what is written last is what a restart finds.
void FlightService::State::keep(const MissionId& mission, std::string document) const {
  const auto write = [&plans = deps.plans, mission, document = std::move(document), now = deps.clock.now()] {
    return plans.keep_procedure(mission, document, now);
  };
  deps.late.write(write);
}

void FlightService::State::recover() {
  const auto kept = deps.plans.procedures();
  if (!kept) return;
  std::vector<std::pair<MissionId, nlohmann::json>> flying;
  for (const auto& [mission, text] : kept.value()) {
    auto j = nlohmann::json::parse(text, nullptr, false);
    if (j.is_object() && j.value("landed", false)) continue;
    deps.missions.prepare(mission);
    deps.missions.set_priors(
        mission, j.is_object() ? priors_of(j.value("clues", nlohmann::json())) : procedure::FlightPriors{});
    flying.emplace_back(mission, std::move(j));
  }
  auto w = work.lock();
  for (const auto& [mission, j] : flying) {
    if (auto found = kept_flight(mission, j)) {
      (void)w->operations.recover(now(), *std::move(found)).has_value();
    } else {
      deps.events.add(EventLevel::critical, "procedure.lost",
                      "the flight before the restart cannot be read: the pilot has it", mission);
    }
  }
  publish_events(*w);
}

}  // namespace anchord::api
