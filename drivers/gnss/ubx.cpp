#include "drivers/gnss/ubx.hpp"

#include <array>
#include <cmath>
#include <utility>

#include "drivers/gnss/bytes.hpp"
#include "drivers/gnss/gps_time.hpp"

namespace anchord::gnss::ubx {
namespace {

constexpr std::size_t k_header = 6, k_overhead = 8;

Error too_short(const char* name, std::size_t size) {
  return make_error(Errc::bad_frame,
                    std::string(name) + " of " + std::to_string(size) + " bytes is too short");
}

bool on_earth(double lat_deg, double lon_deg) { return std::abs(lat_deg) <= 90 && std::abs(lon_deg) <= 180; }

/// flags3 bits 4..1, lastCorrectionAge: upper end of each class in seconds; 0 = not available. The last class
/// has no end: 120 s and older, told as 120, since "unknown" would look better than it is.
std::optional<double> age_of_class(unsigned index) {
  constexpr std::array k_upper_s{0.0, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0, 120.0};
  if (index == 0 || index >= k_upper_s.size()) return std::nullopt;
  return k_upper_s[index];
}

FixClass fix_of_carrier(unsigned carrier, bool differential) {
  if (carrier == 2) return FixClass::rtk_fixed;
  if (carrier == 1) return FixClass::rtk_float;
  return differential ? FixClass::dgps : FixClass::single;
}

Result<Message> parse_pvt(std::string_view p) {
  if (p.size() < 84) return too_short("NAV-PVT", p.size());
  Pvt out;
  out.itow_ms = read_le<std::uint32_t>(p, 0);
  const auto valid = read_le<std::uint8_t>(p, 11);
  if ((valid & 3U) == 3U) {
    const auto days = days_from_civil(read_le<std::uint16_t>(p, 4), read_le<std::uint8_t>(p, 6),
                                      read_le<std::uint8_t>(p, 7));
    // nano is signed: the true time is the whole second plus it, and may lie in the second before.
    const auto tod = time_of_day_ns(read_le<std::uint8_t>(p, 8), read_le<std::uint8_t>(p, 9),
                                    read_le<std::uint8_t>(p, 10), read_le<std::int32_t>(p, 16));
    if (!days || !tod) return make_error(Errc::bad_frame, "NAV-PVT with a date or time that does not exist");
    out.time = UtcTime{*days * k_day_ns + *tod};
  }
  const auto type = read_le<std::uint8_t>(p, 20), flags = read_le<std::uint8_t>(p, 21);
  const auto flags3 = read_le<std::uint16_t>(p, 78);
  const bool fix_ok = (flags & 1U) != 0 && type >= 2 && type <= 4;
  if (fix_ok && (flags3 & 1U) == 0) out.fix = fix_of_carrier(flags >> 6, (flags & 2U) != 0);
  out.age_s = age_of_class((flags3 >> 1) & 15U);
  out.satellites = read_le<std::uint8_t>(p, 23);
  out.lon_deg = read_le<std::int32_t>(p, 24) * 1e-7;
  out.lat_deg = read_le<std::int32_t>(p, 28) * 1e-7;
  out.height_m = read_le<std::int32_t>(p, 32) * 1e-3;
  out.msl_m = read_le<std::int32_t>(p, 36) * 1e-3;
  out.h_acc_m = read_le<std::uint32_t>(p, 40) * 1e-3;
  out.v_acc_m = read_le<std::uint32_t>(p, 44) * 1e-3;
  if (!on_earth(out.lat_deg, out.lon_deg))
    return make_error(Errc::bad_frame, "NAV-PVT with a position off the globe");
  return Message(out);
}

Result<Message> parse_hp(std::string_view p) {
  if (p.size() < 36) return too_short("NAV-HPPOSLLH", p.size());
  HpPosition out;
  out.itow_ms = read_le<std::uint32_t>(p, 4);
  out.valid = (read_le<std::uint8_t>(p, 3) & 1U) == 0;
  const auto fine = [&](std::size_t main, std::size_t small, std::int64_t scale) {
    return read_le<std::int32_t>(p, main) * scale + read_le<std::int8_t>(p, small);
  };
  out.lon_deg = static_cast<double>(fine(8, 24, 100)) * 1e-9;
  out.lat_deg = static_cast<double>(fine(12, 25, 100)) * 1e-9;
  out.height_m = static_cast<double>(fine(16, 26, 10)) * 1e-4;
  out.msl_m = static_cast<double>(fine(20, 27, 10)) * 1e-4;
  out.h_acc_m = read_le<std::uint32_t>(p, 28) * 1e-4;
  out.v_acc_m = read_le<std::uint32_t>(p, 32) * 1e-4;
  if (!on_earth(out.lat_deg, out.lon_deg)) return make_error(Errc::bad_frame, "NAV-HPPOSLLH off the globe");
  return Message(out);
}

Result<Message> parse_covariance(std::string_view p) {
  if (p.size() < 64) return too_short("NAV-COV", p.size());
  Covariance out;
  out.itow_ms = read_le<std::uint32_t>(p, 0);
  if (read_le<std::uint8_t>(p, 5) == 0) return Message(out);
  std::array<double, 6> c{};  // NN NE ND EE ED DD
  for (std::size_t i = 0; i < c.size(); ++i) c[i] = static_cast<double>(read_le<float>(p, 16 + 4 * i));
  Eigen::Matrix3d enu;
  enu << c[3], c[1], -c[4], c[1], c[0], -c[2], -c[4], -c[2], c[5];
  const bool definite =
      enu.allFinite() && enu(0, 0) > 0 && enu(0, 0) * enu(1, 1) - enu(0, 1) * enu(1, 0) > 0 && enu(2, 2) > 0;
  if (!definite) return make_error(Errc::bad_frame, "NAV-COV is no covariance");
  out.position_enu_m2 = enu;
  return Message(out);
}

Result<Message> parse_relative(std::string_view p) {
  if (p.empty()) return too_short("NAV-RELPOSNED", 0);
  const bool v1 = read_le<std::uint8_t>(p, 0) >= 1;
  if (p.size() < (v1 ? 64U : 40U)) return too_short("NAV-RELPOSNED", p.size());
  RelativePosition out;
  out.itow_ms = read_le<std::uint32_t>(p, 4);
  const std::size_t fine = v1 ? 32 : 20, accuracy = v1 ? 36 : 24, flags_at = v1 ? 60 : 36;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    out.ned_m[axis] = read_le<std::int32_t>(p, 8 + 4 * k) * 1e-2 + read_le<std::int8_t>(p, fine + k) * 1e-4;
    out.accuracy_m[axis] = read_le<std::uint32_t>(p, accuracy + 4 * k) * 1e-4;
  }
  const auto flags = read_le<std::uint32_t>(p, flags_at);
  out.valid = (flags & 5U) == 5U;  // fix ok, relative position valid
  if (flags & 1U) out.fix = fix_of_carrier((flags >> 3) & 3U, (flags & 2U) != 0);
  return Message(out);
}

Result<Message> parse_dop(std::string_view p) {
  if (p.size() < 18) return too_short("NAV-DOP", p.size());
  return Message(Dop{read_le<std::uint32_t>(p, 0), read_le<std::uint16_t>(p, 12) * 0.01});
}

Result<Message> parse_end(std::string_view p) {
  if (p.size() < 4) return too_short("NAV-EOE", p.size());
  return Message(EndOfEpoch{read_le<std::uint32_t>(p, 0)});
}

Result<Message> parse_old(std::string_view p) {
  if (p.size() < 4) return too_short("NAV-POSLLH or NAV-SOL", p.size());
  return Message(OldPosition{read_le<std::uint32_t>(p, 0)});
}

struct Kind {
  std::uint8_t message_class, id;
  Result<Message> (*parse)(std::string_view);
};
constexpr std::array k_kinds{Kind{0x01, 0x07, parse_pvt},        Kind{0x01, 0x14, parse_hp},
                             Kind{0x01, 0x36, parse_covariance}, Kind{0x01, 0x3c, parse_relative},
                             Kind{0x01, 0x04, parse_dop},        Kind{0x01, 0x61, parse_end},
                             Kind{0x01, 0x02, parse_old},        Kind{0x01, 0x06, parse_old}};

}  // namespace

Result<Message> parse(std::string_view frame) {
  if (frame.size() < k_overhead) return too_short("UBX frame", frame.size());
  const auto payload = frame.substr(k_header, frame.size() - k_overhead);
  for (const auto& kind : k_kinds) {
    if (read_le<std::uint8_t>(frame, 2) == kind.message_class && read_le<std::uint8_t>(frame, 3) == kind.id) {
      return kind.parse(payload);
    }
  }
  return Message(Other{});
}

void Assembler::select(std::uint32_t itow_ms, Epochs& out) {
  if (group_ && group_->itow_ms == itow_ms) return;
  publish(out);
  if (group_) kinds_ |= group_->kinds();
  group_ = Group{};
  group_->itow_ms = itow_ms;
}

void Assembler::add(const Message& message, Epochs& out) {
  std::visit(
      [&](const auto& m) {
        using T = std::decay_t<decltype(m)>;
        if constexpr (!std::is_same_v<T, Other>) {
          select(m.itow_ms, out);
          if constexpr (std::is_same_v<T, Pvt>) group_->pvt = m;
          if constexpr (std::is_same_v<T, HpPosition>) group_->hp = m;
          if constexpr (std::is_same_v<T, Covariance>) group_->covariance = m;
          if constexpr (std::is_same_v<T, RelativePosition>) group_->relative = m;
          if constexpr (std::is_same_v<T, Dop>) group_->dop = m;
          if constexpr (std::is_same_v<T, OldPosition>) group_->old_position = true;
          if constexpr (std::is_same_v<T, EndOfEpoch>) {
            has_end_ = true;
            publish(out);
          }
        }
      },
      message);
  // Where the receiver marks the end of its epochs, everything of them is waited for; elsewhere what its
  // epochs have held so far, and the first one for the second, since nothing is known of them before.
  if (has_end_ || !group_ || !group_->pvt || !group_->hp || kinds_ == 0) return;
  if ((group_->kinds() & kinds_) == kinds_) publish(out);
}

void Assembler::publish(Epochs& out) {
  if (!group_ || group_->published) return;
  if (!group_->pvt) {
    if ((group_->old_position || group_->hp) && !std::exchange(group_->counted, true)) ++without_pvt_;
    return;
  }
  group_->published = true;
  const Pvt& pvt = *group_->pvt;
  Epoch epoch;
  epoch.protocol = Protocol::ubx;
  epoch.time = pvt.time;
  epoch.fix = pvt.fix;
  epoch.satellites = pvt.satellites;
  if (group_->dop) epoch.hdop = group_->dop->horizontal;
  const bool fine = group_->hp && group_->hp->valid;
  if (pvt.fix != FixClass::none) {
    epoch.lat_deg = fine ? group_->hp->lat_deg : pvt.lat_deg;
    epoch.lon_deg = fine ? group_->hp->lon_deg : pvt.lon_deg;
    epoch.height_ellipsoid_m = fine ? group_->hp->height_m : pvt.height_m;
    epoch.height_msl_m = fine ? group_->hp->msl_m : pvt.msl_m;
    epoch.age_s = pvt.age_s;
    if (group_->covariance && group_->covariance->position_enu_m2) {
      epoch.covariance_enu_m2 = group_->covariance->position_enu_m2;
      const Eigen::Vector3d sigma = epoch.covariance_enu_m2->diagonal().cwiseSqrt();
      epoch.sigma_e_m = sigma.x();
      epoch.sigma_n_m = sigma.y();
      epoch.sigma_u_m = sigma.z();
    } else {
      // hAcc is one number for the plane; taking it whole for each axis never promises too much.
      const double h = fine ? group_->hp->h_acc_m : pvt.h_acc_m, v = fine ? group_->hp->v_acc_m : pvt.v_acc_m;
      if (h > 0) epoch.sigma_e_m = epoch.sigma_n_m = h;
      if (v > 0) epoch.sigma_u_m = v;
    }
    if (group_->relative && group_->relative->valid) epoch.baseline_ned_m = group_->relative->ned_m;
  }
  out.push_back(std::move(epoch));
}

}  // namespace anchord::gnss::ubx
