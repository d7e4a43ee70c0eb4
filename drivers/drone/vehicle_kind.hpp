#pragma once

#include <string_view>

#include "drivers/mavlink/message.hpp"

namespace anchord::drone {

/// Whether this heartbeat is of an aircraft that we can command: an autopilot (not MAV_AUTOPILOT_INVALID) of
/// a multirotor or helicopter. The numbers of modes mean something else in a plane, a rover or a submarine.
bool is_our_kind(const mavlink::Message& heartbeat);

/// What sends this heartbeat: "autopilot" for what is_our_kind(), else by its MAV_TYPE "fixed wing", "VTOL",
/// "ground vehicle", "boat", "submarine", "antenna tracker", "other vehicle", "ground station", "gimbal",
/// "camera" or "other".
std::string_view kind_of_sender(const mavlink::Message& heartbeat);

/// Of a kind of kind_of_sender(): it moves, or aims, by an autopilot of its own, and is not followed.
bool is_another_vehicle(std::string_view kind);

}  // namespace anchord::drone
