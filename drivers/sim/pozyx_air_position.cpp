// What a simulated tag does with its device list: positions, continuous positions, the calibration, and the
// blinking of newer firmware.

#include <algorithm>
#include <cmath>

#include "drivers/pozyx/registers.hpp"
#include "drivers/sim/pozyx_air.hpp"
#include "drivers/sim/pozyx_position.hpp"

namespace anchord::sim {

using namespace pozyx;

namespace {

constexpr std::uint8_t k_last_old_firmware = 0x11;

bool newer(const PozyxDevice& device) { return device.register_value(reg::firmware) > k_last_old_firmware; }

Bytes millimetres(const Eigen::Vector3d& at_m) {
  Bytes out;
  for (const double metres : at_m)
    put_u32(out, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(metres * 1000))));
  return out;
}

/// Registers 3c..47. The register text calls them covariances, the maker's client reads them as millimetres:
/// here the root of each covariance, in millimetres, with its sign.
void set_position_error(PozyxDevice& device, const Eigen::Matrix3d& covariance_m2) {
  std::uint8_t address = reg::pos_err;
  for (const auto& [row, column] : {std::pair{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}) {
    const double m2 = covariance_m2(row, column);
    device.set_i16(address, std::copysign(std::sqrt(std::abs(m2)), m2) * 1000);
    address = static_cast<std::uint8_t>(address + 2);
  }
}

/// What bit i of the flags of POSITIONING_WITH_DATA adds, in the order of the maker's client.
struct Part {
  std::uint8_t address, bytes;
};
constexpr std::array<Part, 9> k_parts{
    {{0x54, 6}, {0x60, 6}, {0x5a, 6}, {0x66, 6}, {0x6c, 8}, {0x74, 6}, {0x7a, 6}, {0x50, 4}, {0x4e, 2}}};

}  // namespace

bool PozyxAir::position(PozyxStation& self, ByteView parameters, double now_s, PozyxStation* asker) {
  // Newer firmware wants its flags in the remote form; a client of the old form gets error 0d (issue 52).
  if (parameters.size() != 0 && parameters.size() != 2) return false;
  if (asker && newer(self.device) && parameters.empty()) return false;
  const unsigned flags = parameters.empty() ? 1u : u16_at(parameters, 0);
  if (asker && (flags & ~0x83ffu) != 0) return false;
  write(self, reg::pos_interval, Bytes{0, 0}, now_s);  // a single position ends the continuous ones
  const double took_s = 4 * air_s(self);
  Random& random = (asker ? *asker : self).random;
  // As with ranges; but who gets flags does not read the acknowledgement at all, and need not be waited for.
  const double patience_s = newer(self.device) ? 0.02 : 0.1;
  if (asker) asker->rx_full_until_s = now_s + took_s + patience_s;
  const auto done = [this, &self, &random, asker, flags](double at_s) {
    if (!locate(self, at_s, random) || !asker) return;
    std::optional<Bytes> data = self.device.read(reg::pos_x, 12);
    if (newer(self.device)) data = position_data(self, flags, k_tx_buffer, at_s);
    if (data) asker->device.receive(self.device.id(), std::move(*data), event::rx_data);
  };
  if (asker) {
    after(self, now_s + took_s, [this, asker, done](double at_s) { when_read(*asker, at_s, done); });
  } else {
    after(self, now_s + took_s, done);
  }
  return true;
}

/// Ranges to the anchors of the list and a position from them, in the frame of the list; an event either way.
bool PozyxAir::locate(PozyxStation& self, double at_s, Random& random) {
  constexpr std::uint8_t k_few_anchors = 0x0a, k_no_position = 0x16;
  PozyxDevice& device = self.device;
  const std::uint8_t selection = device.register_value(reg::pos_num_anchors);
  const std::size_t count = selection & 0x0f;  // sixteen does not fit into four bits
  const std::size_t most = count == 0 ? 16 : std::max<std::size_t>(3, count);
  const auto& fixed = device.positioning_ids();
  const bool automatic = (selection & 0x80) != 0 || fixed.empty();
  std::vector<AnchorRange> anchors;
  std::vector<std::uint16_t> chosen;
  self.used.clear();
  for (const PozyxDevice::Known& known : std::vector<PozyxDevice::Known>(device.list())) {
    if (anchors.size() >= most || !known.anchor) continue;
    if (!automatic && std::find(fixed.begin(), fixed.end(), known.id) == fixed.end()) continue;
    PozyxStation* other = find(known.id);
    const auto measured = other ? exchange(self, *other, at_s, random) : std::nullopt;
    if (!measured || measured->distance_m <= 0) continue;
    store_range(self, known.id, *measured, at_s);
    device.set_impulse(simulate_impulse(*measured, scenario_->impulse, other->random));
    self.used.emplace_back(known.id, device.ranges()[known.id].distance_mm);
    anchors.push_back({coordinates_m(known.coordinates), measured->distance_m});
    chosen.push_back(known.id);
  }
  const int dimension = device.register_value(reg::pos_alg) >> 4 & 3;
  const bool solve_z = dimension != 2 && dimension != 1;
  if (anchors.size() < (solve_z ? 4u : 3u)) {
    device.fail(k_few_anchors);
    return false;
  }
  double height_m = coordinates_m(device.read(reg::pos_x, 12)).z();
  if (dimension == 2) height_m = anchors.front().at_m.z();  // all in one plane
  const auto found = tag_position(anchors, solve_z, height_m);
  if (!found) {
    device.fail(k_no_position);
    return false;
  }
  if (automatic) device.positioning_ids() = chosen;
  if (self.positions_m.size() == k_longest_filter) self.positions_m.erase(self.positions_m.begin());
  self.positions_m.push_back(found->at_m);
  Eigen::Vector3d at_m = filter_position(self.positions_m, device.register_value(reg::pos_filter));
  if (!solve_z) at_m.z() = found->at_m.z();  // given, and not in need of it
  device.set_bytes(reg::pos_x, millimetres(at_m));
  set_position_error(device, found->covariance_m2);
  device.raise(event::pos);
  return true;
}

void PozyxAir::position_for_ever(PozyxStation& self, double now_s) {
  const std::uint64_t round = ++self.rounds;
  const unsigned ms = u16_at(self.device.read(reg::pos_interval, 2), 0);
  if (ms == 0) return;
  const double every_s = std::clamp(ms, 10u, 60'000u) * 1e-3;  // capped by the device
  const auto again = [this, &self, round, every_s](const auto& next, double from_s) -> void {
    after(self, from_s + every_s, [this, &self, round, every_s, next](double at_s) {
      if (self.rounds != round) return;
      locate(self, at_s, self.random);
      // What nobody was there to see is left out.
      const double missed = std::floor(std::max(0.0, now_s_ - at_s) / every_s);
      next(next, at_s + missed * every_s);
    });
  };
  again(again, now_s);
}

/// What DO_POSITIONING found, by flags: bit 0 the position and its status, 1..9 sensors, 15 the ranges. Newer
/// firmware only; ranges that do not fit are left out.
std::optional<Bytes> PozyxAir::position_data(PozyxStation& self, unsigned flags, std::size_t room,
                                             double now_s) {
  if (!newer(self.device) || flags == 0 || (flags & ~0x83ffu) != 0) return std::nullopt;
  Bytes out;
  if (flags & 1) {
    out = self.device.read(reg::pos_x, 12);
    out.push_back(1);  // a valid one
  }
  for (std::size_t i = 0; i < k_parts.size(); ++i) {
    if (!(flags >> (i + 1) & 1)) continue;
    const Bytes part = read(self, k_parts[i].address, k_parts[i].bytes, now_s, false);
    out.insert(out.end(), part.begin(), part.end());
  }
  if (!(flags & 0x8000)) return out;
  constexpr std::size_t k_range_bytes = 6;
  const std::size_t fit = room > out.size() ? (room - out.size() - 1) / k_range_bytes : 0;
  const std::size_t n = std::min(self.used.size(), fit);
  out.push_back(static_cast<std::uint8_t>(n));
  for (std::size_t i = 0; i < n; ++i) {
    put_u16(out, self.used[i].first);
    put_u32(out, self.used[i].second);
  }
  return out;
}

/// The maker's own calibration, a baseline only: the first device is the origin, the second gives the x axis,
/// the third has a positive y. Places are true to a decimetre instead of solved for.
bool PozyxAir::calibrate(PozyxStation& self, ByteView parameters, double now_s, PozyxStation* asker) {
  if (parameters.size() < 2 || parameters.size() % 2 != 0 || parameters.size() > 2 + 2 * 6) return false;
  if ((parameters[0] != 1 && parameters[0] != 2) || parameters[1] == 0) return false;
  std::vector<std::uint16_t> ids;
  for (std::size_t i = 2; i < parameters.size(); i += 2) ids.push_back(u16_at(parameters, i));
  for (const PozyxDevice::Known& known : self.device.list()) {
    if (parameters.size() == 2 && known.anchor && ids.size() < 6) ids.push_back(known.id);
  }
  const double pairs = static_cast<double>(ids.size() * (ids.size() + 1)) / 2;
  const double took_s = std::min(25.0, pairs * parameters[1] * air_s(self));
  const bool heights = parameters[0] == 1;
  Random& random = (asker ? *asker : self).random;
  after(self, now_s + took_s, [this, &self, &random, ids, heights](double at_s) {
    constexpr std::uint8_t k_calibration = 0x0c;
    std::vector<Eigen::Vector3d> at_m;
    for (const std::uint16_t id : ids) {
      PozyxStation* other = find(id);
      if (!other || !exchange(self, *other, at_s, random)) return self.device.fail(k_calibration);
      at_m.push_back(terminal(*other, at_s).enu_m + 0.1 * random.normal3());
    }
    if (at_m.size() < 3) return self.device.fail(k_calibration);
    const Eigen::Vector2d x = (at_m[1] - at_m[0]).head<2>().normalized();
    Eigen::Vector2d y(-x.y(), x.x());
    if ((at_m[2] - at_m[0]).head<2>().dot(y) < 0) y = -y;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const Eigen::Vector2d from_m = (at_m[i] - at_m[0]).head<2>();
      double z_m = 0;
      for (const PozyxDevice::Known& known : self.device.list()) {
        if (heights && known.id == ids[i]) z_m = coordinates_m(known.coordinates).z();
      }
      const Eigen::Vector3d placed_m(i > 0 ? from_m.dot(x) : 0, i > 1 ? from_m.dot(y) : 0, z_m);
      self.device.remember({ids[i], true, millimetres(placed_m)});
    }
    self.device.raise(event::func);
  });
  return true;
}

/// Newer firmware: a tag in ALOHA mode blinks for receivers that listen, none of which are simulated. What
/// the functions take beyond what the maker's Python client sends (0, 1 or 2) no public source says.
bool PozyxAir::blink(PozyxStation& self, ByteView parameters, double now_s) {
  if (!newer(self.device) || (!parameters.empty() && parameters[0] > 2)) return false;
  after(self, now_s + frame_s(self), [&self](double) {
    Bytes count = self.device.read(reg::blink_index, 4);
    const std::uint32_t blinks = u32_at(count, 0) + 1;
    count.clear();
    put_u32(count, blinks);
    self.device.set_bytes(reg::blink_index, count);
    self.device.raise(event::func);
  });
  return true;
}

}  // namespace anchord::sim
