#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace anchord::api {

/// Time between two rounds of something that must come round in time. One thread notes, any thread reads.
class IntervalHistogram {
 public:
  /// A round, at this steady second.
  void note(double now_s);
  /// It need not come round until the next note(), which begins anew.
  void pause() { last_s_.reset(); }
  double worst_s() const { return worst_s_; }  ///< since the start
  /// A histogram `name` and a gauge `name`_worst, in Prometheus text.
  std::string text(std::string_view name) const;

 private:
  static constexpr std::array k_bounds_s{0.11, 0.15, 0.2, 0.25, 0.5, 1.0, 2.5};
  std::optional<double> last_s_;
  std::array<std::atomic<std::uint64_t>, k_bounds_s.size() + 1> counts_{};
  std::atomic<double> sum_s_{0}, worst_s_{0};
};

}  // namespace anchord::api
