#include "drivers/drone/vehicle_kind.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

namespace anchord::drone {
namespace {

constexpr std::int64_t k_no_autopilot = 8;  // MAV_AUTOPILOT_INVALID

// MAV_TYPE of minimal.xml: quadrotor, coaxial, helicopter, hexa-, octo-, tri-, dodeca-, decarotor, generic
// multirotor. GENERIC (0) says nothing.
constexpr std::array<std::int64_t, 9> k_ours{2, 3, 4, 13, 14, 15, 29, 35, 43};

std::string_view word_of_type(std::int64_t type) {
  switch (type) {
    case 1:
      return "fixed wing";
    case 5:
      return "antenna tracker";
    case 6:
      return "ground station";
    case 10:
      return "ground vehicle";
    case 11:
      return "boat";
    case 12:
      return "submarine";
    case 19:
    case 20:
    case 21:
    case 22:
    case 23:
    case 24:
    case 25:
    case 47:
      return "VTOL";
    case 26:
      return "gimbal";
    case 30:
      return "camera";
    case 0:  // generic
    case 7:  // airship, balloon, rocket
    case 8:
    case 9:
    case 16:  // flapping wing, kite, parafoil
    case 17:
    case 28:
    case 45:  // spacecraft, walking robot
    case 46:
      return "other vehicle";
    default:
      return "other";
  }
}

}  // namespace

bool is_our_kind(const mavlink::Message& heartbeat) {
  return heartbeat.is("HEARTBEAT") && heartbeat.integer("autopilot") != k_no_autopilot &&
         std::find(k_ours.begin(), k_ours.end(), heartbeat.integer("type")) != k_ours.end();
}

std::string_view kind_of_sender(const mavlink::Message& heartbeat) {
  if (is_our_kind(heartbeat)) return "autopilot";
  const auto word = word_of_type(heartbeat.integer("type"));
  // A companion computer names the vehicle that it rides on.
  return heartbeat.integer("autopilot") == k_no_autopilot && is_another_vehicle(word) ? "other" : word;
}

bool is_another_vehicle(std::string_view kind) {
  return kind == "fixed wing" || kind == "VTOL" || kind == "ground vehicle" || kind == "boat" ||
         kind == "submarine" || kind == "antenna tracker" || kind == "other vehicle";
}

}  // namespace anchord::drone
