#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "core/ports/drone.hpp"

namespace anchord::drone {

/// Whether two autopilots answer under one system id, as two new ones do on one radio or router: what a
/// single one cannot do goes back and forth again and again. Within 8 s its time since boot goes back three
/// times (a restart: once), or its place jumps four times, or it arms and disarms three times each.
class TwinWatch {
 public:
  void heartbeat(double now_s, bool armed);
  void position(double now_s, std::int64_t boot_ms, const std::optional<Wgs84>& place);
  bool two(double now_s) const;

 private:
  struct Sign {
    std::deque<double> at_s;
    void note(double now_s);
    bool times(double now_s, std::size_t n) const;
  };
  Sign boot_, jump_, arm_;
  std::optional<std::int64_t> boot_ms_;
  std::optional<bool> armed_;
  std::optional<Wgs84> place_;
  double place_s_{0};
};

}  // namespace anchord::drone
