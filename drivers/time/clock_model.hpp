#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

namespace anchord::timing {

struct ClockModelOptions {
  std::int64_t bucket_ns = 1'000'000'000;  ///< of each stretch of device time the least delayed sample counts
  std::size_t window_buckets = 120;        ///< two minutes: crystals wander with temperature beyond that
  std::int64_t early_ns = 50'000'000;  ///< no sample can be early: this much means the device clock jumped
  std::int64_t late_ns = 250'000'000;  ///< late for `late_span_ns` on end: the device clock jumped back
  std::int64_t late_span_ns = 5'000'000'000;  ///< links stall for less
  double max_drift = 1e-2;                    ///< crystals keep 1e-4; beyond 1e-2 it is not a clock
};

/// An instant with its standard uncertainty, nanoseconds.
struct Stamp {
  std::int64_t ns{};
  double sigma_ns{};
};

/// Relation of a device's clock to the host's steady clock, from arrivals (3.3.2).
///
///   arrival = offset + (1 + drift) * device + delay,  delay >= delay_min
///
/// Delays are one-sided, so the line that supports the samples from below is fitted, not their mean: of every
/// bucket the earliest sample, early outliers beyond 8 MAD of a Theil-Sen line dropped, then the edge of the
/// lower convex hull over the mean device time, which is the line below all points with the least sum of
/// distances. The constant part delay_min cannot be told from the offset by anyone; it stays in the offset.
///
/// A device clock that jumps (reboot, leap) starts a new fit. The wall clock is nowhere in here, so its steps
/// disturb nothing. Pure; not thread-safe. device_ns must be unwrapped (see Unwrap).
class ClockModel {
 public:
  explicit ClockModel(const ClockModelOptions& options = {}) : options_(options) {}

  void add(std::int64_t device_ns, std::int64_t arrival_ns);
  /// add(), and when this instant would have arrived with the least delay. Absent where the two do not belong
  /// together, more than `early_ns` after the arrival or `late_span_ns` before it: a digit is wrong, or the
  /// clock has just jumped. The arrival is the better stamp then.
  std::optional<Stamp> stamp(std::int64_t device_ns, std::int64_t arrival_ns);

  /// Steady time at which this instant of the device would have arrived with the least delay; absent before
  /// the first sample.
  std::optional<Stamp> steady_of(std::int64_t device_ns) const;
  /// The inverse.
  std::optional<Stamp> device_of(std::int64_t steady_ns) const;

  double drift() const { return slope_; }  ///< steady seconds per device second, minus 1
  double delay_scale_ns() const {
    return scale_ns_;
  }                                                 ///< typical delay beyond the least one, of bucket minima
  std::size_t samples() const { return samples_; }  ///< since the last jump
  std::uint64_t jumps() const { return jumps_; }
  bool settled() const { return buckets_.size() >= 10; }
  bool drift_known() const { return buckets_.size() >= 20; }
  /// Beyond 200 ppm, twice what the worst crystal does; false while it is not known.
  bool drift_too_large() const;

 private:
  struct Point {
    std::int64_t device_ns{}, lag_ns{};  ///< lag = arrival - device
  };
  void restart();
  bool jumped(std::int64_t device_ns, std::int64_t arrival_ns);
  void fit();
  double lag_at(std::int64_t device_ns) const;
  double sigma_at(std::int64_t device_ns) const;

  ClockModelOptions options_;
  std::deque<Point> buckets_;
  std::int64_t bucket_{0};  ///< number of the newest bucket
  std::int64_t last_device_ns_{0}, reference_ns_{0};
  double lag_ns_{0}, slope_{0}, scale_ns_{0}, spread_s_{0};
  std::int64_t late_since_ns_{0};
  int early_{0};
  bool late_{false};
  std::size_t samples_{0};
  std::uint64_t jumps_{0};
};

/// Counts past the wrap of a counter of `bits` bits.
class Unwrap {
 public:
  explicit Unwrap(int bits) : modulus_(std::int64_t{1} << bits) {}
  /// The nearest continuation of what came before: steps of less than half a wrap, either way.
  std::int64_t operator()(std::uint64_t raw);

 private:
  std::int64_t modulus_;
  std::optional<std::int64_t> last_{};
};

}  // namespace anchord::timing
