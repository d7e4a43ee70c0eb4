#pragma once

#include <condition_variable>
#include <functional>
#include <string>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {
class Clock;
class DeviceRows;
}  // namespace anchord

namespace anchord::api {

class EventLog;
class MissionService;

/// Plays a made-up flight into a mission of its own, on the way that rows of devices take: for whoever has no
/// hardware at hand. One at a time. Thread-safe.
class Demonstration {
 public:
  struct Deps {
    MissionService& missions;
    DeviceRows& rows;
    EventLog& events;
    const Clock& clock;
    std::function<Result<FlightData>()> make{};  ///< the flight; absent: there is none to play
  };
  explicit Demonstration(Deps deps) : deps_(std::move(deps)) {}
  ~Demonstration() { stop(); }
  Demonstration(const Demonstration&) = delete;
  Demonstration& operator=(const Demonstration&) = delete;

  /// So many times as fast as it was flown; it is finished when its last row is in.
  /// errors  conflict: one is flown already, or the server stops; unsupported: there is none; those of the
  /// store
  Result<Mission> start(double speed);
  /// Ends what is played, which stays as far as it came. Idempotent.
  void stop();

 private:
  struct Rows;
  Result<Mission> begin(double speed);
  void play(const MissionId& id, Rows& rows, double speed);

  struct Playing {
    bool now{false}, stopping{false};
    Thread thread;
  };
  Deps deps_;
  Locked<Playing> playing_;
  std::condition_variable wake_;
};

}  // namespace anchord::api
