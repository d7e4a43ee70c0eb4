#pragma once

#include <optional>
#include <string>

#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/event_level.hpp"

namespace anchord {

using EventId = Id<struct EventTag>;

/// A place of a plan: where on the globe, and how high above the plan's ground.
struct EventPlace {
  double lat_deg{}, lon_deg{}, height_above_ground_m{};
};

/// Something an operator should know, as text and as a stable code.
struct LiveEvent {
  EventId id{};
  UtcTime time{};
  EventLevel level{};
  std::string code, text;
  std::optional<MissionId> mission{};
  std::optional<EventPlace> place{};  ///< where the aircraft is sent by it
};

}  // namespace anchord
