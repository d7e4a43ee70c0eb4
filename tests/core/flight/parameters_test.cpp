// Which settings of the autopilot pass the checklist. Values: ArduPilot AP_BattMonitor_Params.cpp,
// AC_Fence.cpp, Parameters.cpp (Copter); PX4 commander_params.c, geofence_params.c.
#include "core/flight/parameters.hpp"

#include <gtest/gtest.h>

#include <set>

namespace anchord::flight::parameters_test {
namespace {

/// Of 0 to 7 those that are found good, everything else set as it should be.
std::set<int> good(const std::string& autopilot, const std::string& name) {
  std::set<int> out;
  for (int value = 0; value < 8; ++value) {
    DroneStatus drone;
    drone.autopilot = autopilot;
    drone.parameters = autopilot == "PX4"
                           ? std::map<std::string, double>{{"NAV_DLL_ACT", 2},
                                                           {"NAV_RCL_ACT", 2},
                                                           {"COM_LOW_BAT_ACT", 3},
                                                           {"GF_ACTION", 2}}
                           : std::map<std::string, double>{
                                 {"FS_GCS_ENABLE", 1}, {"FS_THR_ENABLE", 1},   {"BATT_FS_LOW_ACT", 2},
                                 {"FS_EKF_ACTION", 1}, {"FENCE_ENABLE", 1},    {"FENCE_ACTION", 1},
                                 {"SYSID_MYGCS", 255}, {"MAV_GCS_SYSID", 255}, {"EK3_SRC1_POSXY", 3}};
    drone.parameters.at(name) = value;
    const auto checked = check_parameters(drone);
    EXPECT_TRUE(checked.complete);
    if (checked.wrong.empty()) out.insert(value);
  }
  return out;
}

TEST(FlightParameters, NoFailsafeThatStopsTheMotorsInTheAirIsFoundGood) {
  EXPECT_EQ(good("PX4", "NAV_DLL_ACT"), (std::set{2, 3}));
  EXPECT_EQ(good("PX4", "NAV_RCL_ACT"), (std::set{2, 3}));
  EXPECT_EQ(good("PX4", "COM_LOW_BAT_ACT"), (std::set{2, 3}));
  EXPECT_EQ(good("PX4", "GF_ACTION"), (std::set{2, 3, 5}));
  EXPECT_EQ(good("ArduPilot", "BATT_FS_LOW_ACT"), (std::set{1, 2, 3, 4, 6, 7}));
  EXPECT_FALSE(good("ArduPilot", "FS_GCS_ENABLE").contains(0));
  EXPECT_EQ(good("ArduPilot", "EK3_SRC1_POSXY"), (std::set{3}));
}

}  // namespace
}  // namespace anchord::flight::parameters_test
