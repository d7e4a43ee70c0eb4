// What the aircraft's own autopilot is given to keep: the fence, before every flight, and the route.
#include <algorithm>

#include "core/flight/operations.hpp"
#include "core/flight/parameters.hpp"
#include "core/ports/drone.hpp"

namespace anchord::flight {
namespace {

constexpr double k_retry_s = 10;

bool has_fence(const Plan& plan) { return !plan.fence.empty() || !plan.no_fly.empty(); }

DroneFence fence_of(const Plan& plan) {
  DroneFence fence{plan.fence, plan.no_fly};
  if (plan.outline.size() >= 3) fence.outside.push_back(plan.outline);  // the building itself
  return fence;
}

}  // namespace

Result<FlightCommand> Operations::upload(const Now& now, const MissionId& mission, const Plan& plan,
                                         const std::string& what, const std::string& who) {
  const auto refuse = [](const char* why) { return make_error(Errc::invalid_argument, why); };
  if (drone_ == nullptr)
    return refuse("this server has no link to an autopilot (drone.address): there is nothing to upload to");
  const auto status = drone_->status();
  if (!status.connected) return refuse("no heartbeat is received from the aircraft: check its link");
  if (flying() || status.in_air)
    return refuse("the aircraft is in the air: fence and route can be uploaded only on the ground");
  FlightUpload up{mission, plan.id, plan.version, what, 0, now.s, {}};
  std::uint64_t sent = 0;
  if (what == "fence") {
    if (!has_fence(plan)) return refuse("the plan has neither a fence nor a no-fly area");
    const DroneFence fence = fence_of(plan);
    up.n_items = plan.fence.size();
    for (const auto& area : fence.outside) up.n_items += area.size();
    sent = drone_->upload_fence(fence);
  } else {
    if (plan.waypoints.empty()) return refuse("the plan has no waypoint");
    // Heights of a plan are above its ground; a plan without an origin has it where the aircraft stands.
    double ground_above_home_m = 0;
    const auto r = received_.find(mission);
    if (plan.origin && r != received_.end() && r->second.fix)
      ground_above_home_m = plan.origin->height_m - r->second.fix->position.height_m;
    std::vector<RoutePoint> route;
    for (const auto& w : plan.waypoints)
      route.push_back({w.at, w.height_m + ground_above_home_m, w.heading_deg,
                       w.measure ? w.dwell_s.value_or(plan.settings.dwell_s) : 0});
    up.n_items = route.size();
    sent = drone_->upload_route(route);
  }
  up.command = note(now, mission, "upload_" + what, who);
  by_drone_number_[sent] = up.command.number;
  std::erase_if(uploads_, [&](const FlightUpload& u) { return u.what == what; });
  uploads_.push_back(up);
  return up.command;
}

/// The newest of its kind, for this very plan.
const FlightUpload* Operations::uploaded(const Plan& plan, const std::string& what) const {
  for (const auto& u : uploads_) {
    if (u.what == what && u.plan == plan.id && u.revision == plan.version) return &u;
  }
  return nullptr;
}

/// What the autopilot keeps to by itself, or soon will: nothing can be taken back from it in the air.
std::optional<DroneFence> Operations::fence_given(const Plan& plan) const {
  const auto* up = uploaded(plan, "fence");
  const bool given = up != nullptr &&
                     (up->command.state == CommandState::accepted || up->command.state == CommandState::sent);
  return given ? std::optional(fence_of(plan)) : std::nullopt;
}

/// An operator who looks at the checklist, and lets nobody else's flight be disturbed, means to fly: the
/// fence goes up by itself, and again ten seconds after it was not confirmed.
void Operations::give_fence(const Now& now) {
  if (drone_ != nullptr && !flying()) {
    const auto status = drone_->status();
    if (status.connected && !status.in_air) drone_->ask_parameters(flight_parameters(status.autopilot));
  }
  if (!preparing_ || drone_ == nullptr || flying()) return;
  const auto holder = lease_.holder(now);
  if (holder && holder->mission != preparing_->first) return;  // until the other one has ended
  const Plan& plan = preparing_->second;
  if (!has_fence(plan)) return;
  if (const auto* up = uploaded(plan, "fence")) {
    const bool again = up->command.state == CommandState::unconfirmed && now.s - up->begun_s > k_retry_s;
    if (!again) return;
  }
  const auto status = drone_->status();
  if (status.connected && !status.in_air)
    (void)upload(now, preparing_->first, plan, "fence", "checklist").has_value();
}

std::optional<ChecklistItem> Operations::fence_item(const Plan& plan) const {
  if (!has_fence(plan)) return std::nullopt;
  ChecklistItem item{"fence", "The autopilot has stored the fence", "", false, true, {}, {}};
  const auto* up = uploaded(plan, "fence");
  if (up == nullptr) {
    item.detail = "not sent to the autopilot yet";
  } else {
    item.ok = up->command.state == CommandState::accepted;
    item.detail = up->command.state == CommandState::sent ? "being sent to the autopilot"
                  : *item.ok                              ? up->command.text
                             : std::string(to_string(up->command.state)) + ": " + up->command.text +
                                   "; the server still checks the fence itself";
  }
  return item;
}

}  // namespace anchord::flight
