#pragma once

#include <memory>
#include <optional>
#include <string>

#include "drivers/sim/path.hpp"
#include "drivers/sim/receiver_error.hpp"
#include "drivers/sim/rover_formats.hpp"
#include "drivers/sim/scenario.hpp"

namespace anchord::sim {

/// An RTK receiver as its port shows it: time in, bytes out, the same for everybody who listens. The same
/// seed gives the same bytes. Pure; not thread-safe; time (seconds of the scenario) must not go back.
class RoverSim {
 public:
  /// start  UTC of scenario time 0
  RoverSim(std::shared_ptr<const Scenario> scenario, const RoverSetup& rover, Whereabouts where,
           UtcTime start);
  RoverSim(const RoverSim&) = delete;  // its errors refer to its generator
  RoverSim& operator=(const RoverSim&) = delete;

  /// What is due by now.
  std::string speak(double now_s);
  /// When the next epoch's bytes are due.
  double next_s() const;
  /// Nobody listens: epochs until now are over.
  void skip_to(double now_s);

 private:
  std::string epoch_bytes(std::uint64_t epoch);
  RoverEpoch measure(double at_s, UtcTime time);
  std::string disturbed(std::string bytes);

  std::shared_ptr<const Scenario> scenario_;
  RoverSetup setup_;
  Whereabouts where_;
  UtcTime start_;
  Random random_, noise_;
  ReceiverError error_;
  std::uint64_t next_{0};
};

}  // namespace anchord::sim
