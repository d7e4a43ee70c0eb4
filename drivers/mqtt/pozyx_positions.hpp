#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "drivers/port/driver.hpp"

namespace anchord::mqtt {

/// Positions of tags that a Pozyx Creator or Enterprise gateway computed from anchors that are calibrated
/// already: to check a calibration by. They are no measurement of an anchor and no fix of the aircraft, so no
/// row is made of them. Counted by reason: not_utf8, not_json, too_deep, too_large, bad_update, failed,
/// time_not_set, too_many_tags. Bears any bytes.
class PozyxPositions {
 public:
  explicit PozyxPositions(device::DriverOutput& output) : out_(output) {}
  void message(std::string_view text, const device::Arrival& at);
  /// The newest of each tag: [{"tag", "t_us", "local_m": [x, y, z], "yaw_deg", "anchors"}], in order of id.
  std::string json() const;

 private:
  struct Position {
    std::int64_t t_us{};
    double x_m{}, y_m{}, z_m{};
    std::optional<double> yaw_deg{};
    std::size_t anchors{};  ///< that heard the tag, where the gateway says so
  };
  device::DriverOutput& out_;
  std::map<std::string, Position> newest_;
};

}  // namespace anchord::mqtt
