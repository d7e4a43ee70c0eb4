#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <variant>

#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss::ubx {

/// NAV-PVT (01 07).
struct Pvt {
  std::uint32_t itow_ms{};
  std::optional<UtcTime> time;  ///< absent while the receiver does not vouch for date and time
  FixClass fix{FixClass::none};
  int satellites{};
  double lat_deg{}, lon_deg{}, height_m{}, msl_m{};  ///< 1e-7 deg: 11 mm, too coarse for RTK
  double h_acc_m{}, v_acc_m{};
  std::optional<double> age_s;  ///< upper end of the class in flags3
};
/// NAV-HPPOSLLH (01 14): the same position to 0.1 mm, without fix type.
struct HpPosition {
  std::uint32_t itow_ms{};
  bool valid{false};
  double lat_deg{}, lon_deg{}, height_m{}, msl_m{};
  double h_acc_m{}, v_acc_m{};
};
/// NAV-COV (01 36), rotated to east, north, up.
struct Covariance {
  std::uint32_t itow_ms{};
  std::optional<Eigen::Matrix3d> position_enu_m2;
};
/// NAV-RELPOSNED (01 3C), versions 0 and 1.
struct RelativePosition {
  std::uint32_t itow_ms{};
  bool valid{false};
  Eigen::Vector3d ned_m{0, 0, 0}, accuracy_m{0, 0, 0};
  FixClass fix{FixClass::none};
};
struct Dop {
  std::uint32_t itow_ms{};
  double horizontal{};
};
struct EndOfEpoch {
  std::uint32_t itow_ms{};
};
/// NAV-POSLLH (01 02) or NAV-SOL (01 06): the way of receivers before NAV-PVT. Not decoded, only noticed.
struct OldPosition {
  std::uint32_t itow_ms{};
};
struct Other {};
using Message =
    std::variant<Other, Pvt, HpPosition, Covariance, RelativePosition, Dop, EndOfEpoch, OldPosition>;

/// A whole frame whose checksum is right. errors: bad_frame (payload too short for its kind, value out of its
/// domain). Pure.
Result<Message> parse(std::string_view frame);

/// Joins the messages of one iTOW; published when the next one begins, on NAV-EOE, or as soon as PVT,
/// HPPOSLLH and every other kind that the stream has shown in a former epoch are in. Without a PVT there is
/// no fix type and no epoch.
class Assembler {
 public:
  void add(const Message& message, Epochs& out);
  void finish(Epochs& out) { publish(out); }
  /// Times that had a position in another message, but no NAV-PVT to say what it is worth.
  std::uint64_t without_pvt() const { return without_pvt_; }

 private:
  struct Group {
    std::uint32_t itow_ms{};
    std::optional<Pvt> pvt;
    std::optional<HpPosition> hp;
    std::optional<Covariance> covariance;
    std::optional<RelativePosition> relative;
    std::optional<Dop> dop;
    bool old_position{false};
    bool published{false}, counted{false};

    /// One bit per kind of message that is in.
    unsigned kinds() const {
      return (pvt ? 1U : 0U) | (hp ? 2U : 0U) | (covariance ? 4U : 0U) | (relative ? 8U : 0U) |
             (dop ? 16U : 0U);
    }
  };
  void select(std::uint32_t itow_ms, Epochs& out);
  void publish(Epochs& out);

  std::optional<Group> group_;
  unsigned kinds_{0};  ///< of all finished groups
  bool has_end_{false};
  std::uint64_t without_pvt_{0};
};

}  // namespace anchord::gnss::ubx
