#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/live_event.hpp"

namespace anchord {

/// The events of flights. Append-only; they go with their mission. Callable from any thread; errors as in
/// measurement_store.hpp.
class EventStore {
 public:
  virtual ~EventStore() = default;
  /// In this order, all or none; one that is here already stays as it is, one without a mission or of a
  /// mission that is gone is left out.
  virtual Result<void> append(std::span<const LiveEvent> events) = 0;
  /// Of a mission, last appended first. `since`: not older; `after`: behind this event of the page before,
  /// nothing where it is none of the mission's.
  virtual Result<std::vector<LiveEvent>> events(const MissionId& mission, std::size_t limit,
                                                std::optional<UtcTime> since,
                                                const std::optional<EventId>& after) = 0;
};

}  // namespace anchord
