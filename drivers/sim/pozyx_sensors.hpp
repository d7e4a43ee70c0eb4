#pragma once

#include "drivers/sim/path.hpp"
#include "drivers/sim/pozyx_device.hpp"

namespace anchord::sim {

/// Registers 50..80 of a level tag: pressure and temperature always, the others as the sensor mode has them
/// switched on, else zero. No noise and no acceleration of the flight: gravity alone, the field of Europe (20
/// uT north, 45 down), and the turn about the vertical.
///
/// rate_radps  clockwise seen from above
void fill_sensors(PozyxDevice& device, const Pose& pose, double rate_radps);

}  // namespace anchord::sim
