// What an operator asks of a flight: control, checklist, begin, command; and what a restart brings back.
#include <algorithm>

#include "core/flight/operations.hpp"
#include "core/ports/drone.hpp"

namespace anchord::flight {

namespace {

/// What the procedure is asked; nothing of the actions that are no matter of its own.
std::optional<procedure::Trigger> trigger_of(FlightAction action) {
  switch (action) {
    case FlightAction::hold:
      return procedure::Trigger::hold;
    case FlightAction::resume:
      return procedure::Trigger::resume;
    case FlightAction::skip:
      return procedure::Trigger::skip;
    case FlightAction::return_home:
      return procedure::Trigger::return_home;
    case FlightAction::land:
      return procedure::Trigger::land;
    case FlightAction::start:
    case FlightAction::abort:
    case FlightAction::disarm:
      break;
  }
  return std::nullopt;
}

std::string word_of(FlightAction action) { return std::string(k_flight_action_words.word(action)); }

/// A plan without an origin has its ground where the aircraft stands.
Result<Plan> flown_plan(const Plan& plan, double ground_m) {
  BOOST_OUTCOME_TRY(Wgs84 origin, planning::plan_origin(plan));
  if (!plan.origin) origin.height_m = ground_m;
  Plan flown = plan;
  flown.origin = origin;
  return flown;
}

Error forbidden(std::string why) { return make_error(Errc::invalid_argument, std::move(why)); }

}  // namespace

Result<Lease> Operations::take_control(const Now& now, const MissionId& mission, const Holder& who,
                                       bool by_force, std::string key) {
  const auto before = lease_.holder(now);
  // Who has the aircraft of a mission that is not being flown keeps nobody from today's.
  const bool idle =
      before && before->mission != mission && !(flying() && flight_->mission == before->mission);
  auto lease = lease_.take(mission, who, now, by_force || idle, std::move(key));
  if (lease) {
    log_event(before ? EventLevel::warning : EventLevel::info, "control.taken",
              who.name + (before ? " took control from " + before->name : " has control"), mission);
    show_soon_ = true;
  }
  return lease;
}

Result<void> Operations::release_control(const Now& now, const MissionId& mission, const std::string& key,
                                         const Holder& who) {
  BOOST_OUTCOME_TRYV(lease_.release(mission, key, who, now));
  log_event(EventLevel::info, "control.released", who.name + " gave control back", mission);
  show_soon_ = true;
  return boost::outcome_v2::success();
}

void Operations::end_control(const Now& now, const std::string& token_id) {
  const auto held = lease_.holder(now);
  if (!held || held->token_id != token_id) return;
  (void)lease_.release(held->mission, held->key, {held->token_id, held->name}, now);
  log_event(flying() ? EventLevel::warning : EventLevel::info, "control.ended",
            "control ended: the token of " + held->name + " was revoked or has expired", held->mission);
  show_soon_ = true;
}

std::vector<ChecklistItem> Operations::checklist(const Now& now, const Mission* record,
                                                 const MissionId& mission, const Groundwork& ground,
                                                 bool manual) const {
  const Plan* plan = ground.plan;
  ChecklistFacts facts;
  facts.mission = record;
  if (plan != nullptr) {
    facts.min_battery = plan->settings.min_battery;
    facts.endurance_s = plan->settings.endurance_s;
  }
  facts.plan = ground.check.get();
  if (!manual && drone_ != nullptr) facts.drone = drone_->status();
  if (const auto it = received_.find(mission); it != received_.end()) {
    const auto& r = it->second;
    if (r.fix_s) facts.fix_age_s = now.s - *r.fix_s;
    if (r.fix) facts.fix = r.fix->fix;
    if (r.fixed_since_s) facts.fixed_for_s = now.s - *r.fixed_since_s;
    if (r.range_s) facts.range_age_s = now.s - *r.range_s;
    facts.unknown_tag = r.unknown_tag;
    if (facts.fix_age_s && r.correction_age_s)
      facts.correction_age_s = *facts.fix_age_s + *r.correction_age_s;
  }
  if (plan != nullptr) facts.place_refused = take_off_refused(*plan, mission);
  facts.writable = ground.writable;
  facts.disk_free_bytes = ground.disk_free_bytes;
  auto items = make_checklist(facts);
  if (plan != nullptr && !manual && drone_ != nullptr) {
    if (auto fence = fence_item(*plan)) items.push_back(std::move(*fence));
  }
  if (const auto it = overridden_.find(mission); it != overridden_.end()) {
    for (auto& i : items) {
      const auto found = it->second.find(i.id);
      if (found == it->second.end() || !i.overridable) continue;
      i.overridden_by = found->second.who;
      i.override_reason = found->second.reason;
    }
  }
  return items;
}

/// Judged as the flight itself will be; absent where nothing is known to judge by.
std::optional<std::string> Operations::take_off_refused(const Plan& plan, const MissionId& mission) const {
  const auto it = received_.find(mission);
  if (it == received_.end() || !it->second.fix || it->second.fix->frame != TrackFrame::wgs84)
    return std::nullopt;
  const auto& stands = it->second.fix->position;
  const auto flown = flown_plan(plan, stands.height_m);
  if (!flown) return flown.error().message;
  const Eigen::Vector3d here = EnuFrame(*flown.value().origin).enu_from_wgs84(stands).m;
  const auto setup = procedure::flight_setup(flown.value(), here);
  if (!setup) return setup.error().message;
  const auto refused = procedure::refuse_take_off(setup.value().limits.bounds, here,
                                                  procedure::take_off_height_m(setup.value()));
  return refused ? refused->text : std::string{};
}

Result<void> Operations::override_item(const Now& now, const MissionId& mission, const std::string& item,
                                       const std::string& reason, const std::string& who,
                                       const Groundwork& ground) {
  for (const auto& one : checklist(now, nullptr, mission, ground, drone_ == nullptr)) {
    if (one.id == item && !one.overridable)
      return make_error(Errc::invalid_argument, item + " cannot be overridden: " + one.text);
  }
  overridden_[mission][item] = {who, reason};
  log_event(EventLevel::info, "checklist." + item, who + ": " + reason, mission);
  return boost::outcome_v2::success();
}

Result<FlightCommand> Operations::begin(const Now& now, const Mission& mission, const Groundwork& ground,
                                        bool manual, const std::string& who) {
  const Plan& plan = *ground.plan;
  manual = manual || drone_ == nullptr;
  if (flying()) return forbidden("a flight is already in the air");
  const bool in_air = !manual && drone_->status().in_air;
  std::optional<Wgs84> took_off_from;
  if (in_air) {
    if (const auto* before = flight_of(mission.id))
      took_off_from = before->frame.wgs84_from_enu(Enu{before->home_m});
    if (!took_off_from)
      return forbidden("the aircraft is in the air and its take-off point is not known: land it first");
  }
  if (mission.frame != TrackFrame::wgs84)
    return forbidden(
        "a mission in a local frame cannot be flown: the aircraft needs coordinates in WGS84; create the "
        "mission in frame wgs84");
  preparing_.emplace(mission.id, plan);
  std::string open;
  for (const auto& i : checklist(now, &mission, mission.id, ground, manual)) {
    if (!i.green()) open += (open.empty() ? "" : ", ") + i.id;
  }
  if (!open.empty()) return forbidden("the checklist is not green: " + open);
  const auto& r = received_[mission.id];
  if (!r.fix || r.fix->frame != TrackFrame::wgs84) return forbidden("the aircraft's position is not known");
  BOOST_OUTCOME_TRY(const Plan flown,
                    flown_plan(plan, (took_off_from ? *took_off_from : r.fix->position).height_m));
  const EnuFrame frame(*flown.origin);
  const Eigen::Vector3d here = frame.enu_from_wgs84(r.fix->position).m;
  // Home is on the ground: where this mission took off, when it starts again in the air.
  const Eigen::Vector3d home = took_off_from ? frame.enu_from_wgs84(*took_off_from).m : here;
  BOOST_OUTCOME_TRY(auto setup, procedure::flight_setup(flown, home));
  setup.decides_apart = decides_apart_;
  // A new flight is a new object, and so is what the link knows of it.
  flight_.emplace(mission.id, flown, manual, frame, home,
                  procedure::FlightControl(std::move(setup), frame, manual ? nullptr : drone_));
  ++n_flights_;
  auto& f = *flight_;
  if (ground.check) f.forecast = f.forecast_at_start = ground.check->time;
  f.changes.own_origin = plan.origin.has_value();
  if (!manual) f.changes.autopilot_keeps = fence_given(plan);
  f.control.fix(*r.fix_s, here, r.fix->fix);
  if (manual) {
    f.by_hand.position_m = here;
    f.former_s = *r.fix_s;
    f.control.by_hand(now.s, f.by_hand);
  }
  by_drone_number_.clear();
  unconfirmed_.reset();
  const auto number_of_start = note(now, mission.id, word_of(FlightAction::start), who).number;
  f.control.start(now.s, who);
  note_dispatched(now, f, find(number_of_start));
  take_events(f);
  overridden_.erase(mission.id);  // of the next flight every item is asked again
  return *find(number_of_start);
}

/// Whatever the server believes: who has control can always command the aircraft to hold, to land, to disarm.
FlightCommand Operations::act_directly(const Now& now, const MissionId& mission, FlightAction action,
                                       const std::string& who) {
  auto& command = note(now, mission, word_of(action), who);
  if (drone_ == nullptr) {
    command.state = CommandState::accepted;
    command.text = "shown to the pilot";
    return command;
  }
  if (flying() && !flight_->manual && flight_->control.taken_over()) drone_->take_back();
  by_drone_number_[action == FlightAction::hold   ? drone_->hold()
                   : action == FlightAction::land ? drone_->land()
                                                  : drone_->disarm()] = command.number;
  return command;
}

Result<FlightCommand> Operations::act(const Now& now, const MissionId& mission, FlightAction action,
                                      const std::string& who) {
  const bool flies = flight_of(mission) != nullptr && flying();
  const bool disarms = action == FlightAction::disarm;
  const bool always = action == FlightAction::hold || action == FlightAction::land || disarms;
  if (disarms || (always && !flies)) return act_directly(now, mission, action, who);
  if (!flies) return forbidden("this mission is not being flown");
  auto& f = *flight_;
  if (action == FlightAction::abort) {
    auto& command = note(now, mission, word_of(action), who);
    if (f.manual)
      command.state = CommandState::accepted;
    else
      by_drone_number_[f.control.abort()] = command.number;
    f.aborted = "aborted by " + who + ": the pilot flies the aircraft";
    f.aborted_s = now.s;
    log_event(EventLevel::warning, "procedure.aborted", f.aborted, mission);
    return command;
  }
  const auto event = trigger_of(action);
  if (!event) return forbidden("the flight is already running: there is nothing to " + word_of(action));
  const auto number = note(now, mission, word_of(action), who).number;
  if (const auto why_not = f.control.command(now.s, *event, who); !why_not.empty()) {
    std::erase_if(commands_, [&](const FlightCommand& c) { return c.number == number; });
    return forbidden(word_of(action) + ": " + why_not);
  }
  note_dispatched(now, f, find(number));
  take_events(f);
  return *find(number);
}

Result<DroneStatus> Operations::change_aircraft(const MissionId& mission, const std::string& sender,
                                                const std::string& who) {
  if (drone_ == nullptr)
    return make_error(Errc::invalid_argument, "this server has no link to an autopilot (drone.address)");
  const auto before = drone_->status();
  if (before.connected && (before.in_air || flying()))
    return make_error(Errc::invalid_argument,
                      "the aircraft on the link is in the air: land it before you change to another one");
  drone_->change_peer(sender);
  log_event(EventLevel::warning, "drone.changed",
            who + (sender.empty() ? ": the next autopilot that sends a heartbeat becomes the aircraft"
                                  : ": the autopilot at " + sender + " is now the aircraft"),
            mission);
  return drone_->status();
}

Result<void> Operations::recover(const Now& now, KeptFlight kept) {
  const EnuFrame frame(kept.plan.origin.value());
  const auto& changes = kept.changes;
  BOOST_OUTCOME_TRY(auto setup, setup_of(kept.plan, changes.kept, changes.autopilot_keeps, kept.home_m));
  setup.decides_apart = decides_apart_;
  const bool manual = kept.manual || drone_ == nullptr;
  // Before the flight, which is a new one on the link.
  if (!manual && kept.aircraft.system > 0) drone_->expect(kept.aircraft);
  flight_.emplace(
      kept.mission, std::move(kept.plan), manual, frame, kept.home_m,
      procedure::FlightControl(std::move(setup), frame, manual ? nullptr : drone_, kept.state, now.s));
  ++n_flights_;
  flight_->priors_before = std::move(kept.priors);
  flight_->changes = std::move(kept.changes);
  flight_->forecast_at_start = kept.forecast_at_start;
  if (const auto check = planning::check_plan(flight_->plan); check && flight_->changes.n == 0)
    flight_->forecast = check.value().time;
  // Not heard yet: whether the hold leaves is decided by the mode that the first heartbeat shows.
  take_events(*flight_);
  log_event(
      EventLevel::critical, "procedure.restarted",
      "server restarted in flight: on hold, waiting for the operator; an aircraft in a mode of its own or "
      "of its pilot is left in it",
      kept.mission);
  return boost::outcome_v2::success();
}

}  // namespace anchord::flight
