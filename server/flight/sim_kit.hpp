#pragma once

#include <optional>
#include <vector>

#include "core/types/flight_data.hpp"
#include "drivers/sim/radio.hpp"
#include "drivers/sim/random.hpp"
#include "drivers/sim/receiver_error.hpp"
#include "drivers/sim/vehicle.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::flight {

/// Tag and rover of a simulated vehicle: what they measure while it flies. One seed, the same numbers.
class SimKit {
 public:
  /// `start`: of the first measurement; a fixed day unless given.
  SimKit(const sim::World& world, const sim::RadioOptions& radio, std::uint64_t seed,
         std::optional<UtcTime> start = {});

  struct Measured {
    std::vector<Fix> fixes;
    std::vector<Range> ranges;
  };
  /// Moves the vehicle on by one step (0.1 s) and gives what was measured meanwhile.
  Measured advance(sim::Vehicle& vehicle);
  /// The same for a vehicle that somebody else moved on by one step from `before_m`.
  Measured observe(const Eigen::Vector3d& before_m, const sim::Vehicle& vehicle);
  void set_fix_lost(bool lost) { fix_lost_ = lost; }
  void set_tag_silent(bool silent) { tag_silent_ = silent; }

  Mission mission() const;
  double now_s() const { return static_cast<double>(n_) * k_step_s; }
  UtcTime time_at(double seconds) const;
  static constexpr double k_step_s = 0.1;

 private:
  Eigen::Quaterniond attitude(double heading_rad, double time_s) const;

  const sim::World& world_;
  sim::RadioOptions radio_;
  UtcTime start_;
  sim::Random fix_random_, range_random_;
  sim::ReceiverError error_;
  std::vector<double> bias_m_;
  std::uint64_t n_{0}, n_ranges_{0};
  bool fix_lost_{false}, tag_silent_{false};
};

}  // namespace anchord::flight
