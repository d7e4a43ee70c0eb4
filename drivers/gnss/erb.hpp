#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <variant>

#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss::erb {

struct Position {
  std::uint32_t tow_ms{};
  double lat_deg{}, lon_deg{}, height_m{}, msl_m{};
  double
      acc_3d_m{};  ///< sqrt(acc_h^2 + acc_v^2): the two are of ECEF axes, only together they mean something
};
struct Status {
  std::uint32_t tow_ms{};
  int gps_week{};
  FixClass fix{FixClass::none};
  int satellites{};
  std::optional<double> age_s;  ///< in the 37-byte form only
};
struct Dops {
  std::uint32_t tow_ms{};
  double horizontal{};
};
struct Velocity {
  std::uint32_t tow_ms{};
};
/// Message 07; it has no time of its own.
struct Rtk {
  int satellites{};  ///< used; STAT counts those in view
  std::optional<double> age_s;
  Eigen::Vector3d baseline_ned_m{0, 0, 0};
};
struct Other {};
using Message = std::variant<Other, Position, Status, Dops, Velocity, Rtk>;

/// A whole frame whose checksum is right. STAT is told apart by its length, not by the version. errors:
/// bad_frame.
Result<Message> parse(std::string_view frame);

/// Collects by time of week, since POS comes before the STAT that qualifies it. Published on RTK, the last
/// message of an epoch, or when the next one begins. Time is GPS time; leap seconds are taken out here.
class Assembler {
 public:
  void add(const Message& message, Epochs& out);
  void finish(Epochs& out) { publish(out); }

 private:
  struct Group {
    std::uint32_t tow_ms{};
    std::optional<Position> position;
    std::optional<Status> status;
    std::optional<Dops> dops;
    std::optional<Rtk> rtk;
  };
  void publish(Epochs& out);
  std::optional<Group> group_;
};

}  // namespace anchord::gnss::erb
