#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"

namespace anchord {
class MissionBin;
}

namespace anchord::api {

class CirRetention;
class EventLog;
class RunningTime;

/// What is removed after its time, little by little on a thread of its own: deleted missions, kept answers,
/// and impulse responses that go into files. A slice is one short transaction and is followed by a pause, so
/// that a flight that records never waits for it.
class Housekeeping {
 public:
  struct Deps {
    MissionBin& bin;
    const RunningTime& running;
    EventLog& events;
    std::function<bool()> purge_answers;  ///< one slice; true: there may be more
    CirRetention& cir_retention;
    std::int64_t keep_deleted_ns{30LL * 86'400 * 1'000'000'000};
    bool by_hand{false};  ///< no thread: the owner calls round() (tests)
  };
  explicit Housekeeping(Deps deps) : deps_(std::move(deps)) {}
  ~Housekeeping() { stop(); }

  void start();
  void stop();
  /// Something was marked for removal: begin now.
  void wake();
  /// Everything that is due.
  void round();

 private:
  void loop();
  bool pause(std::chrono::milliseconds time);
  void remove_marked();

  struct Wishes {
    bool stop{false}, round{false};
  };

  const Deps deps_;
  Locked<Wishes> wishes_;
  std::condition_variable told_;
  Thread thread_;
};

}  // namespace anchord::api
