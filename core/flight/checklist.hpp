#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/planning/local_plan.hpp"
#include "core/ports/drone.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"

namespace anchord::flight {

/// One item before take-off. `ok` absent: a person must say so.
struct ChecklistItem {
  std::string id, text, detail;
  std::optional<bool> ok{};
  bool overridable{false};
  std::string overridden_by, override_reason;  ///< or who confirmed a manual item
  bool green() const { return ok.value_or(false) || !overridden_by.empty(); }
};

/// What is known when the list is made.
struct ChecklistFacts {
  const Mission* mission{};
  const planning::PlanCheck* plan{};    ///< absent: no plan chosen
  std::optional<DroneStatus> drone{};   ///< absent: flown by hand
  std::optional<double> fix_age_s{};    ///< newest fix of the mission
  std::optional<FixClass> fix{};        ///< of it
  std::optional<double> fixed_for_s{};  ///< RTK fixed without a break
  std::optional<double> correction_age_s{};
  std::optional<double> range_age_s{};     ///< newest range
  std::optional<NetworkId> unknown_tag{};  ///< whose ranges come, and that the mission does not have
  double disk_free_bytes{};
  bool writable{true};
  double min_battery{0.3};
  double endurance_s{1200};  ///< on a full battery
  /// What keeps the aircraft from taking off where it stands; empty: nothing. Absent: not known where it is.
  std::optional<std::string> place_refused{};
};

/// Every item, in the order of the screen. Start is blocked until all are green.
std::vector<ChecklistItem> make_checklist(const ChecklistFacts& facts);
bool is_checklist_item(std::string_view id);

/// Share of the battery that a flight of so many seconds needs: what it uses with a margin of 30 %, above
/// what it returns at. Above 1: no battery is enough.
double battery_need(double flight_s, double endurance_s, double min_battery);

}  // namespace anchord::flight
