#include "core/flight/parameters.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <span>

namespace anchord::flight {
namespace {

struct Rule {
  const char* name;
  bool (*good)(double);
  const char* wanted;
};

// What stops the motors in the air (ArduPilot: terminate; PX4: terminate, disarm) is no failsafe of a flight
// beside a building.
bool set(double value) { return value != 0; }
bool set_and_flies(double value) { return value != 0 && value != 5; }     // BATT_FS_LOW_ACT: 5 terminates
bool returns_or_lands(double value) { return value == 2 || value == 3; }  // 0 nothing, 1 warns or holds
bool stays_inside(double value) { return value == 2 || value == 3 || value == 5; }  // GF_ACTION: 4 terminates
bool server(double value) { return value == 255; }
bool satellites(double value) { return value == 3; }

// ArduCopter Parameters.cpp, AP_BattMonitor, AC_Fence, AP_NavEKF_Source; MAV_GCS_SYSID is the newer name.
constexpr std::array<Rule, 9> k_ardupilot{
    {{"FS_GCS_ENABLE", set, "not 0: a failsafe when the link is lost"},
     {"FS_THR_ENABLE", set, "not 0: a failsafe when the remote control is lost"},
     {"BATT_FS_LOW_ACT", set_and_flies,
      "a failsafe of the battery: not 0, and not 5, which stops the motors"},
     {"FS_EKF_ACTION", set, "not 0: a failsafe when the position is lost"},
     {"FENCE_ENABLE", set, "1: the fence is kept"},
     {"FENCE_ACTION", set, "not 0: more than a report at the fence"},
     {"EK3_SRC1_POSXY", satellites, "3: the position is GNSS"},
     {"SYSID_MYGCS", server, "255: the server's heartbeats count"},
     {"MAV_GCS_SYSID", server, "255: the server's heartbeats count"}}};
// PX4: commander_params.c, navigator geofence_params.c.
constexpr std::array<Rule, 4> k_px4{
    {{"NAV_DLL_ACT", returns_or_lands, "2 or 3: return or land when the link is lost"},
     {"NAV_RCL_ACT", returns_or_lands, "2 or 3: return or land when the remote control is lost"},
     {"COM_LOW_BAT_ACT", returns_or_lands, "2 or 3: land or return on a low battery"},
     {"GF_ACTION", stays_inside, "2, 3 or 5: hold, return or land at the fence"}}};

std::span<const Rule> rules(std::string_view autopilot) {
  if (autopilot == "ArduPilot") return k_ardupilot;
  if (autopilot == "PX4") return k_px4;
  return {};
}

}  // namespace

std::vector<std::string> flight_parameters(std::string_view autopilot) {
  std::vector<std::string> out;
  for (const auto& rule : rules(autopilot)) out.emplace_back(rule.name);
  return out;
}

ParameterCheck check_parameters(const DroneStatus& drone) {
  ParameterCheck out{true, {}};
  for (const auto& rule : rules(drone.autopilot)) {
    const auto it = drone.parameters.find(rule.name);
    if (it == drone.parameters.end()) {
      const auto& unknown = drone.parameters_unknown;
      out.complete = out.complete && std::find(unknown.begin(), unknown.end(), rule.name) != unknown.end();
    } else if (!rule.good(it->second)) {
      std::array<char, 160> text{};
      std::snprintf(text.data(), text.size(), "%s%s is %g, wanted %s", out.wrong.empty() ? "" : "; ",
                    rule.name, it->second, rule.wanted);
      out.wrong += text.data();
    }
  }
  return out;
}

}  // namespace anchord::flight
