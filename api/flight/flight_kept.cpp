// What of a flight is kept, so that a server that was killed goes on with it.
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/flight/flight_state.hpp"
#include "api/flight/kept_outcome.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/kit/late_writer.hpp"
#include "api/planning/site_structures.hpp"
#include "core/base/to_wire.hpp"
#include "core/flight/hand_over.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {
namespace {

constexpr std::uint64_t k_aborted = 1'000'000;  // beyond any number of transitions
constexpr std::uint64_t k_change = 10'000'000;  // and of both

/// System 0 where it is not said: whoever is heard first.
DroneIdentity aircraft_of(const nlohmann::json& stored) {
  if (!stored.is_object()) return {};
  return {stored.value("peer", ""), stored.value("system", 0), stored.value("component", 0)};
}

nlohmann::ordered_json document_of(const Plan& plan) {
  return {{"id", to_string(plan.id)},
          {"revision", plan.version},
          {"plan", nlohmann::json::parse(stored(plan).document.text)}};
}
std::optional<Plan> plan_in(const nlohmann::json& j) {
  if (!j.is_object()) return std::nullopt;
  std::vector<FieldError> errors;
  Plan plan = read_plan(j.value("plan", nlohmann::json()), errors);
  if (!errors.empty()) return std::nullopt;
  if (const auto id = parse_uuid(j.value("id", ""))) plan.id = PlanId{id.value()};
  plan.version = j.value("revision", 1ULL);
  return plan;
}

/// Areas and the kept waypoint are written as plans: what reads one reads them.
nlohmann::ordered_json changes_json(const flight::FlownChanges& c) {
  nlohmann::ordered_json out{{"n", c.n},
                             {"at_us", c.at.us()},
                             {"by", c.by},
                             {"own_origin", c.own_origin},
                             {"saved_revision", c.saved_revision}};
  if (c.former) out["former"] = document_of(*c.former);
  if (c.kept) {
    Plan at;
    at.name = "waypoint";
    at.waypoints = {c.kept->waypoint};
    out["kept"] = {{"at", c.kept->at}, {"extra", c.kept->extra}, {"of", document_of(at)}};
  }
  if (c.autopilot_keeps) {
    Plan areas;
    areas.name = "areas";
    areas.fence = c.autopilot_keeps->inside;
    areas.no_fly = c.autopilot_keeps->outside;
    out["autopilot_keeps"] = document_of(areas);
  }
  return out;
}
/// Of a flight that an older server began: nothing was changed, and its plan's origin was written with it.
flight::FlownChanges changes_of(const nlohmann::json& j) {
  flight::FlownChanges out;
  if (!j.is_object()) return out;
  out.n = j.value("n", 0ULL);
  out.at = UtcTime::from_us(j.value("at_us", 0LL));
  out.by = j.value("by", "");
  out.own_origin = j.value("own_origin", true);
  out.saved_revision = j.value("saved_revision", 0ULL);
  out.former = plan_in(j.value("former", nlohmann::json()));
  if (const auto kept = j.value("kept", nlohmann::json()); kept.is_object()) {
    const auto at = plan_in(kept.value("of", nlohmann::json()));
    if (at && at->waypoints.size() == 1)
      out.kept =
          flight::KeptPlace{at->waypoints[0], kept.value("at", std::size_t{0}), kept.value("extra", false)};
  }
  if (const auto areas = plan_in(j.value("autopilot_keeps", nlohmann::json())))
    out.autopilot_keeps = DroneFence{areas->fence, areas->no_fly};
  return out;
}

KeptOutcome outcome_of(const flight::ActiveFlight& f) {
  return {f.priors(), flight::targets_of(f.plan), f.flown_time()};
}

flight::KeptFlight copy_of(const flight::ActiveFlight& f) {
  return {.mission = f.mission,
          .plan = f.plan,
          .manual = f.manual,
          .home_m = f.home_m,
          .state = f.control.engine().state(),
          .priors = f.priors(),
          .aircraft = f.aircraft,
          .changes = f.changes,
          .forecast_at_start = f.forecast_at_start};
}

nlohmann::ordered_json document_of(const flight::KeptFlight& f) {
  const Wgs84 o = f.plan.origin.value();
  const auto& a = f.aircraft;
  return {{"plan", nlohmann::json::parse(stored(f.plan).document.text)},
          {"plan_id", to_string(f.plan.id)},
          {"plan_revision", f.plan.version},
          {"manual", f.manual},
          {"aircraft", {{"peer", a.peer}, {"system", a.system}, {"component", a.component}}},
          {"origin", {o.lat_deg, o.lon_deg, o.height_m}},
          {"home_m", {f.home_m.x(), f.home_m.y(), f.home_m.z()}},
          {"changes", changes_json(f.changes)},
          {"targets", stored_targets(flight::targets_of(f.plan))},
          {"forecast_at_start", forecast_json(f.forecast_at_start)},
          {"state", stored_state(f.state)},
          {"priors", stored_priors(f.priors)}};
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
  out.changes = changes_of(j.value("changes", nlohmann::json()));
  out.forecast_at_start = forecast_of(j.value("forecast_at_start", nlohmann::json()));
  out.priors = priors_in_document(j);
  return out;
}

}  // namespace

std::optional<FlightService::State::ToKeep> FlightService::State::to_keep(Work& w,
                                                                          const flight::ActiveFlight& f) {
  const auto n = f.control.engine().state().n_transitions + (f.aborted.empty() ? 0 : k_aborted) +
                 k_change * (f.changes.n + f.changes.saved_revision + f.changes.n_anchor_orders);
  if (n == w.last.kept) return std::nullopt;
  w.last.kept = n;
  // What it found, what was wanted and how long it took outlive the flight: its calibrations ask for them.
  if (f.flying()) return copy_of(f);
  return outcome_of(f);
}

/// In memory before the disk has it.
template <class Part>
Part FlightService::State::outcome(const MissionId& mission, Part KeptOutcome::*part) {
  {
    const auto w = work.lock();
    if (const auto* f = w->operations.flight_of(mission)) return outcome_of(*f).*part;
  }
  return kept_outcome(deps.plans, mission).*part;
}

PlanTargets FlightService::targets(const MissionId& mission) {
  return state_->outcome(mission, &KeptOutcome::targets);
}

std::optional<flight::FlownTime> FlightService::flown_time(const MissionId& mission) {
  return state_->outcome(mission, &KeptOutcome::time);
}

/// A disk that is slow or full makes no flight wait: what is written last is what a restart finds.
void FlightService::State::keep(const MissionId& mission, const ToKeep& what) const {
  const auto* flying = std::get_if<flight::KeptFlight>(&what);
  std::string document =
      to_wire(flying != nullptr ? document_of(*flying) : stored_outcome(std::get<KeptOutcome>(what)));
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
    deps.missions.set_priors(mission, priors_in_document(j));
    flying.emplace_back(mission, std::move(j));
  }
  std::vector<std::optional<flight::KeptFlight>> read;
  for (const auto& [mission, j] : flying) {
    read.push_back(kept_flight(mission, j));
    // A flight goes on without walls rather than not at all; its own areas are in its plan.
    if (read.back()) (void)deps.structures.join(read.back()->plan).has_value();
  }
  for (std::size_t i = 0; i < flying.size(); ++i) {
    if (auto& found = read[i]) {
      operate([&](auto& operations, const auto& at) {
        return operations.recover(at, *std::move(found)).has_value();
      });
    } else {
      deps.events.add(EventLevel::critical, "procedure.lost",
                      "the flight from before the restart cannot be read: the pilot has to fly the aircraft",
                      flying[i].first);
    }
  }
}

}  // namespace anchord::api
