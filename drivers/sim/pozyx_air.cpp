#include "drivers/sim/pozyx_air.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/check.hpp"
#include "drivers/pozyx/registers.hpp"
#include "drivers/sim/pozyx_sensors.hpp"

namespace anchord::sim {

using namespace pozyx;

namespace {

std::uint16_t short_id(NetworkId id) { return static_cast<std::uint16_t>(id.value); }

}  // namespace

PozyxAir::PozyxAir(std::shared_ptr<const Scenario> scenario, Whereabouts where)
    : scenario_(std::move(scenario)), where_(std::move(where)) {
  const auto add = [this](NetworkId id, const TagSetup& setup, bool is_tag) -> PozyxStation& {
    PozyxDevice device(short_id(id), is_tag, setup.firmware, setup.rates, setup.plen);
    PozyxStation station{.device = std::move(device),
                         .setup = setup,
                         .is_tag = is_tag,
                         .random = Random(scenario_->seed * 0x9e3779b97f4a7c15u ^ id.value)};
    return stations_.emplace(short_id(id), std::move(station)).first->second;
  };
  for (const TagSetup& tag : scenario_->tags) add(tag.id, tag, true);
  // Antenna delays belong to the devices: the same for every tag of the scenario, whatever it asks.
  Random kit(scenario_->seed);
  for (const WorldAnchor& anchor : scenario_->world.anchors) {
    const double bias_m = scenario_->radio.anchor_bias_sigma_m * kit.normal();
    if (scenario_->tags.empty() || stations_.contains(short_id(anchor.id))) continue;
    PozyxStation& station = add(anchor.id, scenario_->tags.front(), false);
    station.enu_m = anchor.enu_m;
    station.bias_m = bias_m;
    if (anchor.clock_drift_ppm) station.setup.clock_drift_ppm = *anchor.clock_drift_ppm;
  }
}

PozyxStation& PozyxAir::tag(NetworkId label) {
  const auto found = stations_.find(short_id(label));
  ANCHORD_CHECK(found != stations_.end(), "no tag " << label.value << " in the scenario");
  return found->second;
}

const PozyxStation* PozyxAir::by_label(NetworkId label) const {
  const auto found = stations_.find(short_id(label));
  return found == stations_.end() ? nullptr : &found->second;
}

PozyxStation* PozyxAir::find(std::uint16_t id) {
  for (auto& [label, station] : stations_) {
    if (station.device.id() == id) return &station;
  }
  return nullptr;
}

bool PozyxAir::faulty(const PozyxStation& station, FaultKind kind, double now_s) const {
  return station.is_tag && fault_at(*scenario_, station.setup.name, kind, now_s) != nullptr;
}

void PozyxAir::restart(PozyxStation& station, double now_s) {
  std::erase_if(pending_, [&](const Pending& pending) { return pending.owner == &station; });
  station.device.reset();
  station.boot_s = station.imu_s = now_s;
  station.fresh = station.asked_imu = false;
  station.polling_since_s.reset();
  station.used.clear();
  station.positions_m.clear();
  position_for_ever(station, now_s);  // where an interval is in flash
}

void PozyxAir::after(const PozyxStation& owner, double at_s, std::function<void(double)> done) {
  pending_.push_back({at_s, &owner, std::move(done)});
}

void PozyxAir::run_until(double now_s) {
  now_s_ = now_s;
  for (;;) {
    const auto first = std::min_element(pending_.begin(), pending_.end(),
                                        [](const Pending& a, const Pending& b) { return a.at_s < b.at_s; });
    if (first == pending_.end() || first->at_s > now_s) return;
    const Pending due = std::move(*first);
    pending_.erase(first);
    due.done(due.at_s);
  }
}

Bytes PozyxAir::read(PozyxStation& self, std::uint8_t address, std::size_t n, double now_s, bool by_wire) {
  const auto covers = [&](std::size_t from, std::size_t to) { return address <= to && address + n > from; };
  if (covers(reg::max_lin_acc, reg::temperature)) sense(self, now_s);
  if (by_wire && covers(reg::int_status, reg::int_status)) inertial_event(self, now_s);
  return self.device.read(address, n);
}

bool PozyxAir::write(PozyxStation& self, std::uint8_t address, ByteView data, double now_s) {
  const auto covers = [&](std::size_t at) { return address <= at && address + data.size() > at; };
  self.polling_since_s.reset();
  const bool all = self.device.write(address, data);
  if (covers(reg::pos_interval) || covers(reg::pos_interval + 1)) position_for_ever(self, now_s);
  if (covers(reg::sensors_mode)) self.asked_imu = true;
  return all;
}

PozyxDevice::Answer PozyxAir::call(PozyxStation& self, std::uint8_t function, ByteView parameters,
                                   double now_s, PozyxStation* asker) {
  self.polling_since_s.reset();
  if (auto plain = self.device.call(function, parameters)) return std::move(*plain);
  PozyxDevice::Answer answer;
  switch (function) {
    case fn::reset:
      restart(self, now_s);
      break;
    case fn::do_ranging:
      answer.accepted = range(self, parameters, now_s, asker);
      break;
    case fn::do_positioning:
      answer.accepted = position(self, parameters, now_s, asker);
      break;
    case fn::positioning_with_data: {
      constexpr std::size_t k_line = 254;  // a reply counts its bytes in one, with the status
      auto data = position_data(self, parameters.size() == 2 ? u16_at(parameters, 0) : 0u,
                                asker ? k_tx_buffer - 1 : k_line, now_s);
      answer.accepted = data.has_value();
      if (data) answer.result = std::move(*data);
      break;
    }
    case fn::devices_discover:
      answer.accepted = discover(self, parameters, now_s, asker);
      break;
    case fn::devices_calibrate:
      answer.accepted = calibrate(self, parameters, now_s, asker);
      break;
    case fn::tx_send:
      answer.accepted =
          parameters.size() == 1 ? blink(self, parameters, now_s) : send(self, parameters, now_s);
      break;
    case fn::do_aloha:
      answer.accepted = blink(self, parameters, now_s);
      break;
    default:
      answer.accepted = false;
  }
  if (!answer.accepted) self.device.fail(0x0d);
  return answer;
}

bool PozyxAir::range(PozyxStation& self, ByteView parameters, double now_s, PozyxStation* asker) {
  if (parameters.size() != 2 || u16_at(parameters, 0) == 0) return false;
  const std::uint16_t to = u16_at(parameters, 0);
  ++(asker ? *asker : self).exchanges;
  if (!asker && faulty(self, FaultKind::no_event, now_s)) return true;
  const double took_s = air_s(self);
  const auto done = [this, &self, asker, to, took_s](double at_s) {
    if (!asker && faulty(self, FaultKind::stale, at_s)) return self.device.raise(event::func);
    PozyxStation* other = find(to);
    const double measured_s = at_s - 0.4 * took_s;
    const auto measured =
        other ? exchange(self, *other, measured_s, (asker ? *asker : self).random) : std::nullopt;
    if (!measured) return self.device.fail(0x12);  // and nothing is pushed
    Exchange result = *measured;
    if (!asker && faulty(self, FaultKind::zero, at_s)) result.distance_m = 0;
    store_range(self, to, result, measured_s);
    self.device.set_impulse(simulate_impulse(result, scenario_->impulse, self.random));
    // Also where it was told by radio: doRangingSlave of the maker's client waits for that at its own tag.
    self.device.raise(event::func);
    self.fresh = self.fresh || !asker;
    if (!asker) return;
    Bytes distance;
    put_u32(distance, self.device.ranges()[to].distance_mm);
    asker->device.receive(self.device.id(), std::move(distance), event::rx_data);
  };
  if (!asker) {
    after(self, now_s + took_s, done);
    return true;
  }
  // The buffer holds one message: the result waits until the acknowledgement was read, though not for ever.
  // Clients need some 10 ms for that, about as long as the fastest exchange lasts.
  constexpr double k_patience_s = 0.1;
  asker->rx_full_until_s = now_s + took_s + k_patience_s;
  after(self, now_s + took_s, [this, asker, done](double at_s) { when_read(*asker, at_s, done); });
  return true;
}

bool PozyxAir::discover(PozyxStation& self, ByteView parameters, double now_s, PozyxStation* asker) {
  const int type = parameters.empty() ? 0 : parameters[0];
  const int slots = parameters.size() > 1 ? parameters[1] : 3;
  const int slot_ms = parameters.size() > 2 ? parameters[2] : 10;
  if (type > 2 || parameters.size() > 3) return false;
  // Slots "by settings" have room for one frame; the maker's client waits 100 ms for all of them.
  const double slot_s = slot_ms > 0 ? 0.001 * slot_ms : frame_s(self) + 0.001;
  Random& random = (asker ? *asker : self).random;
  after(self, now_s + slot_s * (slots + 10), [this, &self, &random, type](double at_s) {
    for (auto& [label, other] : stations_) {
      if (&other == &self) continue;
      // Random slots: answers collide, so some devices are missed each time.
      const auto heard = exchange(self, other, at_s, random);
      if (!heard || !random.chance(0.85)) continue;
      const bool anchor = other.device.register_value(reg::operation_mode) == 1;
      if (type != 2 && anchor != (type == 0)) continue;
      const std::uint16_t id = other.device.id();
      if (!self.device.list_has(id)) self.device.remember({id, anchor, Bytes(12)});
      self.device.set_impulse(simulate_impulse(*heard, scenario_->impulse, other.random));
    }
    self.device.raise(event::func);
  });
  return true;
}

std::optional<Exchange> PozyxAir::exchange(PozyxStation& from, PozyxStation& to, double at_s,
                                           Random& random) {
  auto result =
      simulate_exchange(scenario_->world, scenario_->radio, terminal(from, at_s), terminal(to, at_s), random);
  if (from.device.air() != to.device.air() || &from == &to) return std::nullopt;
  return result;
}

void PozyxAir::store_range(PozyxStation& from, std::uint16_t to, const Exchange& exchange, double at_s) {
  from.device.ranges()[to] = {clock_ms(from, at_s),
                              static_cast<std::uint32_t>(std::lround(exchange.distance_m * 1000)),
                              static_cast<std::int16_t>(std::lround(exchange.rss_dbm))};
  const PozyxStation* other = find(to);
  const bool anchor = !other || other->device.register_value(reg::operation_mode) == 1;
  if (!from.device.list_has(to)) from.device.remember({to, anchor, Bytes(12)});
}

Terminal PozyxAir::terminal(const PozyxStation& station, double at_s) const {
  const double clock_ppm = station.setup.clock_drift_ppm;
  if (!station.is_tag) return {station.enu_m, {}, station.bias_m, clock_ppm};
  const Pose pose = where_(at_s);
  return {pose.enu_m + pose.enu_from_body() * station.setup.lever_arm_m, pose.heading_rad, 0, clock_ppm};
}

std::uint32_t PozyxAir::clock_ms(const PozyxStation& station, double at_s) const {
  const double since_s = at_s - station.boot_s;
  return static_cast<std::uint32_t>(
      std::max(0.0, since_s * (1 + 1e-6 * station.setup.clock_drift_ppm) * 1000.0));
}

double PozyxAir::air_s(const PozyxStation& station) const {
  return station.setup.range_s.value_or(station.device.exchange_s());
}

double PozyxAir::frame_s(const PozyxStation& station) const {
  return (station.device.exchange_s() - 0.010) / 3;  // exchange_s: three frames and the work between them
}

void PozyxAir::sense(PozyxStation& self, double now_s) {
  if (!self.is_tag) return;
  const Pose pose = where_(now_s);
  const double passed_s = now_s - self.turned_s;
  // Between questions far apart nobody knows how often it turned.
  double turned_rad = passed_s > 0.001 && passed_s < 1 ? pose.heading_rad - self.heading_rad : 0;
  turned_rad = std::remainder(turned_rad, 2 * 3.14159265358979323846);
  const double rate_radps = passed_s > 0.001 ? turned_rad / passed_s : 0;
  self.turned_s = now_s;
  self.heading_rad = pose.heading_rad;
  fill_sensors(self.device, pose, rate_radps);
}

/// 100 inertial events a second, as the maker's test of the sensors counts them in a mode it has set. The
/// description shows a tag that has none of them in register 05 though nobody has switched the sensors off,
/// while the maker's orientation tutorial waits for them without having switched anything on. So a host that
/// has never set a mode sees them only when it does nothing but look for events.
void PozyxAir::inertial_event(PozyxStation& self, double now_s) {
  constexpr double k_period_s = 0.010, k_patience_s = 0.020;
  const bool busy = self.device.register_value(reg::int_status) != 0 ||
                    std::any_of(pending_.begin(), pending_.end(),
                                [&](const Pending& pending) { return pending.owner == &self; });
  if (busy || !self.polling_since_s) self.polling_since_s = now_s;
  const bool waits = now_s - *self.polling_since_s >= k_patience_s;
  if (self.device.register_value(reg::sensors_mode) == 0 || (!self.asked_imu && !waits)) return;
  if (now_s - self.imu_s < k_period_s) return;
  self.imu_s = std::max(self.imu_s + k_period_s, now_s - k_period_s);
  self.device.raise(event::imu);
}

}  // namespace anchord::sim
