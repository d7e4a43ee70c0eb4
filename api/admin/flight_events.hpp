#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/live_event.hpp"

namespace anchord {
class EventStore;
}

namespace anchord::api {

class LateWriter;

/// The events of flights, which outlive the server: stored after they were published, since a flight waits for no
/// disk, and read with those that are not stored yet. Thread-safe.
class FlightEvents {
 public:
  /// So many wait at most for a database that takes nothing; then the oldest is let go, and stands in the
  /// server's log alone.
  static constexpr std::size_t k_max_waiting = 10'000;
  /// Both must outlive it; the writer ends first.
  FlightEvents(EventStore& store, LateWriter& writer) : store_(store), writer_(writer) {}

  /// Nothing where it is of no mission. Waits for nothing.
  void keep(const LiveEvent& event);
  /// Of a mission, newest first. `after`: behind this event of the page before.
  Result<std::vector<LiveEvent>> newest(const MissionId& mission, std::size_t limit,
                                        std::optional<UtcTime> since = {},
                                        const std::optional<EventId>& after = {}) const;
  /// All of a mission, oldest first, at most so many of the newest.
  Result<std::vector<LiveEvent>> all(const MissionId& mission, std::size_t most) const;

 private:
  std::vector<LiveEvent> waiting() const;
  /// One write takes all that wait when it runs.
  Result<void> store_waiting();

  EventStore& store_;
  LateWriter& writer_;
  Locked<std::vector<LiveEvent>> waiting_;  ///< oldest first
};

}  // namespace anchord::api
