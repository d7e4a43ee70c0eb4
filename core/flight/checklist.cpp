#include "core/flight/checklist.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "core/flight/known_tags.hpp"
#include "core/flight/parameters.hpp"

namespace anchord::flight {
namespace {

constexpr std::array<std::pair<std::string_view, std::string_view>, 4> k_by_a_person{
    {{"props", "Propellers and battery are fastened"},
     {"airspace", "The airspace is clear and the flight is permitted"},
     {"people", "Nobody is below the flight path"},
     {"pilot", "A pilot is ready with the remote control"}}};
constexpr std::array<std::string_view, 13> k_by_itself{
    "drone", "station", "arming", "parameters", "battery",   "rtk",  "corrections",
    "tag",   "plan",    "place",  "disk",       "recording", "fence"};
constexpr double k_fresh_s = 5;  ///< nothing is green on older telemetry

std::string words(const char* format, double value, double other = 0) {
  std::array<char, 200> out{};
  std::snprintf(out.data(), out.size(), format, value, other);
  return out.data();
}

std::string age(const std::optional<double>& seconds) {
  return seconds ? words("%.1f s old", *seconds) : "never";
}

std::string fix_word(const std::optional<FixClass>& fix) {
  if (!fix || *fix == FixClass::none) return "no fix";
  return *fix == FixClass::rtk_fixed   ? "fixed just now"
         : *fix == FixClass::rtk_float ? "RTK float"
                                       : "no RTK";
}

/// Another ground station under our own id; nullptr: none within k_fresh_s.
const OtherOnLink* same_station(const DroneStatus& d) {
  const auto at = std::ranges::find_if(d.others, [](const OtherOnLink& o) {
    return o.kind == "ground station" && o.system == k_station_system && o.component == k_station_component &&
           o.silent_s < k_fresh_s;
  });
  return at == d.others.end() ? nullptr : &*at;
}

ChecklistItem item(const char* id, const char* text, bool ok, bool overridable, std::string detail) {
  return {id, text, std::move(detail), ok, overridable, {}, {}};
}

ChecklistItem station_item(const OtherOnLink& same) {
  return item("station", "No other ground station has the id of this one", false, true,
              (same.sender.empty() ? std::string("one on the link") : "one at " + same.sender) +
                  words(" sends as system %.0f", same.system) + words(", component %.0f", same.component) +
                  ": the autopilot's answers to it can be taken for answers to anchord; give it another "
                  "system id (QGroundControl: Application Settings, MAVLink, Ground Station ID)");
}

ChecklistItem battery_item(const DroneStatus& d, const ChecklistFacts& f) {
  const double flight_s = f.plan != nullptr ? f.plan->time.expected_s : 0;
  const double need = battery_need(flight_s, f.endurance_s, f.min_battery);
  const bool fresh = d.battery && d.battery_age_s < k_fresh_s;
  std::string text = "unknown";
  if (d.battery_warning > 0)
    text = "the autopilot reports a battery warning";
  else if (fresh && need > 1)
    text = words(
        "the flight of %.0f min and its reserve need more than the %.0f min of a full battery: "
        "divide the plan, or correct its endurance_s",
        flight_s / 60, f.endurance_s / 60);
  else if (fresh)
    text = words("%.0f %% left, %.0f %% needed", 100 * *d.battery, 100 * need) +
           words(" (endurance on a full battery: %.0f min)", f.endurance_s / 60);
  return item("battery", "The battery covers the plan plus 30 % reserve",
              fresh && d.battery_warning == 0 && *d.battery >= need, true, text);
}

}  // namespace

double battery_need(double flight_s, double endurance_s, double min_battery) {
  constexpr double k_margin = 1.3;
  return min_battery + k_margin * flight_s / endurance_s;
}

std::vector<ChecklistItem> make_checklist(const ChecklistFacts& f) {
  std::vector<ChecklistItem> out;
  if (f.drone) {
    const auto& d = *f.drone;
    std::string stale;
    for (const auto& name : d.stale) stale += (stale.empty() ? "no telemetry for 5 s: " : ", ") + name;
    for (const auto& refused : d.streams_refused)
      if (!stale.empty()) stale += "; the autopilot refuses " + refused;
    const bool alone = d.link_trouble.empty();
    out.push_back(item("drone", "The aircraft answers", d.connected && !d.failsafe && stale.empty() && alone,
                       false,
                       !alone           ? d.link_trouble
                       : !d.connected   ? "no heartbeat" + (d.link_fault.empty() ? "" : ": " + d.link_fault)
                       : !stale.empty() ? stale
                                        : d.autopilot + ", " + d.mode + (d.failsafe ? ", failsafe" : "")));
    if (const auto* same = same_station(d)) out.push_back(station_item(*same));
    auto arming =
        item("arming", "The autopilot is ready to arm", d.ready_to_arm.value_or(false), true,
             d.ready_to_arm.value_or(false) ? "its pre-arm checks pass"
             : !d.ready_to_arm ? "the autopilot does not report whether it is ready: check the ground station"
             : d.not_ready.empty() ? "its pre-arm checks do not pass yet"
                                   : d.not_ready);
    if (!d.ready_to_arm && d.connected) arming.ok.reset();
    if (!d.connected || !stale.empty()) arming.ok = false;
    out.push_back(std::move(arming));
    const auto parameters = check_parameters(d);
    out.push_back(item("parameters", "The autopilot's failsafes are set",
                       parameters.complete && parameters.wrong.empty(), true,
                       !parameters.wrong.empty() ? parameters.wrong
                       : parameters.complete
                           ? std::to_string(d.parameters.size()) + " parameters read, all as required"
                           : "being read"));
    out.push_back(battery_item(d, f));
  }
  out.push_back(item(
      "rtk", "RTK has been fixed for 10 s", f.fixed_for_s && *f.fixed_for_s >= 10 && *f.fix_age_s < 2, true,
      f.fixed_for_s ? words("fixed for %.0f s", *f.fixed_for_s) : fix_word(f.fix) + ", " + age(f.fix_age_s)));
  out.push_back(item("corrections", "Corrections are younger than 2 s",
                     f.correction_age_s && *f.correction_age_s < 2, true, age(f.correction_age_s)));
  out.push_back(item("tag", "The tag has measured a range in the last 10 s",
                     f.range_age_s && *f.range_age_s < 10 && !f.unknown_tag, true,
                     f.unknown_tag
                         ? "ranges come from tag " + to_string(*f.unknown_tag) +
                               ", which the mission does not have (" +
                               (f.mission != nullptr ? tags_text(*f.mission) : "") + "): they are not used"
                         : "newest range: " + age(f.range_age_s)));
  std::string why = "no plan is chosen";
  if (f.plan != nullptr) {
    why = f.plan->flyable() ? "no error found" : "";
    for (const auto& i : f.plan->issues) {
      if (i.severity == planning::Severity::error && why.size() < 300)
        why += (why.empty() ? "" : "; ") + i.text;
    }
  }
  out.push_back(item("plan", "The plan can be flown", f.plan != nullptr && f.plan->flyable(), false, why));
  out.push_back(item("place", "The aircraft may take off from where it is",
                     f.place_refused && f.place_refused->empty(), false,
                     f.plan == nullptr  ? "no plan is chosen"
                     : !f.place_refused ? "its position is not known: no position received from the rover"
                     : f.place_refused->empty() ? "inside the fence and outside every no-fly area"
                                                : *f.place_refused));
  out.push_back(item("disk", "More than 1 GB of disk is free", f.writable && f.disk_free_bytes > 1e9, true,
                     words("%.1f GB", f.disk_free_bytes / 1e9)));
  const bool open = f.mission != nullptr && f.mission->state != MissionState::finished;
  out.push_back(
      item("recording", "The mission is recording", open, false, open ? "" : "the mission is finished"));
  for (const auto& [id, text] : k_by_a_person)
    out.push_back(
        {std::string(id), std::string(text), "must be confirmed by a person", std::nullopt, true, {}, {}});
  return out;
}

bool is_checklist_item(std::string_view id) {
  return std::any_of(k_by_a_person.begin(), k_by_a_person.end(),
                     [&](const auto& one) { return one.first == id; }) ||
         std::find(k_by_itself.begin(), k_by_itself.end(), id) != k_by_itself.end();
}

}  // namespace anchord::flight
