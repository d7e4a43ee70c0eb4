#include "drivers/gnss/erb.hpp"

#include <array>
#include <cmath>

#include "drivers/gnss/bytes.hpp"
#include "drivers/gnss/gps_time.hpp"

namespace anchord::gnss::erb {
namespace {

constexpr std::size_t k_header = 5, k_overhead = 7;
constexpr std::uint32_t k_week_ms = 604'800'000;

Error bad(const char* name, const std::string& what) {
  return make_error(Errc::bad_frame, std::string(name) + ": " + what);
}

std::optional<double> age_of(std::uint16_t centiseconds) {
  if (centiseconds == 0 || centiseconds == 65535) return std::nullopt;  // no corrections, overflow
  return centiseconds * 0.01;
}

Result<Message> parse_position(std::string_view p) {
  Position out;
  out.tow_ms = read_le<std::uint32_t>(p, 0);
  out.lon_deg = read_le<double>(p, 4);
  out.lat_deg = read_le<double>(p, 12);
  out.height_m = read_le<double>(p, 20);
  out.msl_m = read_le<double>(p, 28);
  out.acc_3d_m = std::hypot(read_le<std::uint32_t>(p, 36), read_le<std::uint32_t>(p, 40)) * 1e-3;
  // Comparisons are false for NaN, so it ends here too.
  if (!(std::abs(out.lat_deg) <= 90) || !(std::abs(out.lon_deg) <= 180)) return bad("POS", "off the globe");
  // What Reach sends before its first solution: the ECEF origin, a finite number that is no position.
  constexpr double k_below_ground_m = -6e6;
  if (out.height_m < k_below_ground_m) return Message(Other{});
  if (!(std::abs(out.height_m) < 1e5) || !(std::abs(out.msl_m) < 1e5))
    return bad("POS", "height not believable");
  return Message(out);
}

Result<Message> parse_status(std::string_view p) {
  Status out;
  out.tow_ms = read_le<std::uint32_t>(p, 0);
  out.gps_week = read_le<std::uint16_t>(p, 4);
  const auto type = read_le<std::uint8_t>(p, 6);
  constexpr std::array k_fixes{FixClass::none, FixClass::single, FixClass::rtk_float, FixClass::rtk_fixed};
  if (type >= k_fixes.size()) return bad("STAT", "fix type " + std::to_string(type));
  if (read_le<std::uint8_t>(p, 7) & 1U) out.fix = k_fixes[type];
  out.satellites = read_le<std::uint8_t>(p, 8);
  if (p.size() >= 37) out.age_s = age_of(read_le<std::uint16_t>(p, 10));
  return Message(out);
}

// Order on the wire: geometric, position, vertical, horizontal.
Result<Message> parse_dops(std::string_view p) {
  return Message(Dops{read_le<std::uint32_t>(p, 0), read_le<std::uint16_t>(p, 10) * 0.01});
}

Result<Message> parse_velocity(std::string_view p) { return Message(Velocity{read_le<std::uint32_t>(p, 0)}); }

Result<Message> parse_rtk(std::string_view p) {
  Rtk out;
  out.satellites = read_le<std::uint8_t>(p, 0);
  out.age_s = age_of(read_le<std::uint16_t>(p, 1));
  for (std::size_t k = 0; k < 3; ++k) {
    out.baseline_ned_m[static_cast<Eigen::Index>(k)] = read_le<std::int32_t>(p, 3 + 4 * k) * 1e-3;
  }
  return Message(out);  // base_tow is said to be ms and holds seconds: not used
}

struct Kind {
  std::uint8_t id;
  std::size_t min_payload;
  const char* name;
  Result<Message> (*parse)(std::string_view);
};
constexpr std::array k_kinds{Kind{2, 44, "POS", parse_position}, Kind{3, 9, "STAT", parse_status},
                             Kind{4, 12, "DOPS", parse_dops}, Kind{5, 28, "VEL", parse_velocity},
                             Kind{7, 23, "RTK", parse_rtk}};

template <class T>
constexpr bool k_has_tow = !std::is_same_v<T, Other> && !std::is_same_v<T, Rtk>;

}  // namespace

Result<Message> parse(std::string_view frame) {
  if (frame.size() < k_overhead) return bad("ERB", "frame too short");
  const auto payload = frame.substr(k_header, frame.size() - k_overhead);
  for (const auto& kind : k_kinds) {
    if (read_le<std::uint8_t>(frame, 2) != kind.id) continue;
    if (payload.size() < kind.min_payload)
      return bad(kind.name, std::to_string(payload.size()) + " bytes are too few");
    return kind.parse(payload);
  }
  return Message(Other{});
}

void Assembler::add(const Message& message, Epochs& out) {
  std::visit(
      [&](const auto& m) {
        using T = std::decay_t<decltype(m)>;
        if constexpr (k_has_tow<T>) {
          if (!group_ || group_->tow_ms != m.tow_ms) {
            publish(out);
            group_ = Group{};
            group_->tow_ms = m.tow_ms;
          }
        }
        if constexpr (std::is_same_v<T, Position>) group_->position = m;
        if constexpr (std::is_same_v<T, Status>) group_->status = m;
        if constexpr (std::is_same_v<T, Dops>) group_->dops = m;
        if constexpr (std::is_same_v<T, Rtk>) {
          if (group_) group_->rtk = m;
          publish(out);
        }
      },
      message);
}

void Assembler::publish(Epochs& out) {
  if (!group_) return;
  const Group group = *group_;
  group_.reset();
  if (!group.status) return;  // neither week nor fix: nothing to say about this time
  Epoch epoch;
  epoch.protocol = Protocol::erb;
  // Before it knows the time Reach sends tow 0 of a week like 65014.
  if (group.tow_ms < k_week_ms && group.status->gps_week > 0 && group.status->gps_week <= k_last_gps_week) {
    epoch.time =
        utc_from_gps_week(group.status->gps_week, static_cast<std::int64_t>(group.tow_ms) * 1'000'000);
  }
  epoch.satellites = group.status->satellites;
  if (group.rtk) epoch.satellites = group.rtk->satellites;
  if (group.dops && group.dops->horizontal > 0) epoch.hdop = group.dops->horizontal;
  if (group.status->fix != FixClass::none && group.position) {
    epoch.fix = group.status->fix;
    epoch.lat_deg = group.position->lat_deg;
    epoch.lon_deg = group.position->lon_deg;
    epoch.height_ellipsoid_m = group.position->height_m;
    epoch.height_msl_m = group.position->msl_m;
    epoch.age_s = group.status->age_s;
    if (group.rtk) {
      epoch.age_s = group.rtk->age_s;
      epoch.baseline_ned_m = group.rtk->baseline_ned_m;
    }
    // 0 means unknown. The 3D value for every axis: more than any of them, but nothing finer is in the
    // format.
    if (group.position->acc_3d_m > 0)
      epoch.sigma_e_m = epoch.sigma_n_m = epoch.sigma_u_m = group.position->acc_3d_m;
  }
  out.push_back(std::move(epoch));
}

}  // namespace anchord::gnss::erb
