#include "server/flight/inline_flight.hpp"

#include <utility>

namespace anchord::flight {
namespace {

LiveMissionSetup live_setup(const InlineFlight::Setup& setup) {
  LiveMissionSetup out;
  out.mission = setup.mission;
  out.live.origin = setup.plan.origin;
  out.live.update_interval_s = setup.live_update_s;
  return out;
}

}  // namespace

InlineFlight::InlineFlight(Setup setup, Drone& drone)
    : setup_(std::move(setup)),
      positions_(setup_.mission, {}, setup_.plan.origin, {}),
      live_(live_setup(setup_)),
      operations_(&drone) {}

void InlineFlight::publish_events() {
  for (const auto& event : live_.take_events()) {
    on_event(event);
    report(*this, setup_.mission.id, event);
  }
}

void InlineFlight::step(const Now& now, std::span<const Fix> fixes, std::span<const Range> ranges) {
  now_ = now;
  for (const auto& range : ranges) live_.add(LiveRow(PredictedRange{range, {}, range.time}));
  for (const auto& fix : fixes) {
    for (const auto& event : positions_.add(fix)) {
      on_position(event);
      report(*this, event);
    }
    live_.add(LiveRow(fix));
  }
  live_.settle();
  publish_events();
  const bool deciding = wants_estimates(operations_).has_value();
  std::optional<Operations::Estimates> estimates;
  if (deciding && live_.origin()) estimates = {*live_.origin(), live_.estimates()};
  operations_.round(now, estimates, deciding);
  auto given = hand_over_.take(operations_);
  if (!setup_.use_priors) given.priors.reset();
  give(live_, std::move(given));
}

Result<void> InlineFlight::start(const Now& now) {
  const Holder who{"token", "the operator"};
  if (!operations_.control(now)) {
    BOOST_OUTCOME_TRYV(operations_.take_control(now, setup_.mission.id, who, false, "key"));
  }
  BOOST_OUTCOME_TRY(auto check, planning::check_plan(setup_.plan));
  const Groundwork ground{&setup_.plan, std::make_shared<const planning::PlanCheck>(std::move(check)), true,
                          1e12};
  for (const auto& item : operations_.checklist(now, &setup_.mission, setup_.mission.id, ground, false)) {
    if (item.green() || !item.overridable) continue;
    BOOST_OUTCOME_TRYV(
        operations_.override_item(now, setup_.mission.id, item.id, "simulated", who.name, ground));
  }
  BOOST_OUTCOME_TRYV(operations_.begin(now, setup_.mission, ground, false, who.name));
  return boost::outcome_v2::success();
}

void InlineFlight::finish() {
  live_.finish();
  live_.settle();
}

}  // namespace anchord::flight
