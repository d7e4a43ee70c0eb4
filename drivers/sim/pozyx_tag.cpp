#include "drivers/sim/pozyx_tag.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "drivers/pozyx/registers.hpp"

namespace anchord::sim {

using namespace pozyx;

namespace {

std::uint16_t short_id(NetworkId id) { return static_cast<std::uint16_t>(id.value); }

}  // namespace

PozyxTag::PozyxTag(std::shared_ptr<const Scenario> scenario, const TagSetup& tag, Whereabouts where)
    : scenario_(std::move(scenario)),
      setup_(tag),
      where_(std::move(where)),
      random_(scenario_->seed * 0x9e3779b97f4a7c15u ^ tag.id.value),
      self_(short_id(tag.id), true, tag.firmware, tag.rates, tag.plen) {
  // Antenna delays belong to the devices: the same for every tag of the scenario, whatever it asks.
  Random kit(scenario_->seed);
  for (const WorldAnchor& anchor : scenario_->world.anchors) {
    others_.emplace(short_id(anchor.id),
                    PozyxDevice(short_id(anchor.id), false, tag.firmware, tag.rates, tag.plen));
    bias_m_[short_id(anchor.id)] = scenario_->radio.anchor_bias_sigma_m * kit.normal();
  }
}

void PozyxTag::power_up(double now_s) {
  run_until(now_s);
  pending_.clear();
  replies_.clear();
  fresh_ = false;
  lines_.clear();
  self_.reset();
  boot_s_ = now_s;
}

bool PozyxTag::faulty(FaultKind kind, double now_s) const {
  return fault_at(*scenario_, setup_.name, kind, now_s) != nullptr;
}

void PozyxTag::hear(std::string_view bytes, double now_s) {
  run_until(now_s);
  lines_.feed(bytes);
  while (const auto line = lines_.next()) {
    // What a tag says to an unknown or broken command is not known: silence, which a host must bear anyway.
    if (const auto command = parse_command(*line)) take(command.value(), now_s);
  }
}

void PozyxTag::take(const Command& command, double now_s) {
  update_sensors(now_s);
  switch (command.kind) {
    case Command::Kind::write:
      self_.write(command.address, command.data);
      return;
    case Command::Kind::read:
      return say(reply_line(self_.read(command.address, command.count)), now_s);
    case Command::Kind::function: {
      const Bytes answer = call(command, now_s);
      const bool range =
          command.address == fn::device_get_range_info && answer.front() == 1 && std::exchange(fresh_, false);
      return say(reply_line(answer), now_s, range);
    }
  }
}

void PozyxTag::say(std::string bytes, double now_s, bool range) {
  if (faulty(FaultKind::silence, now_s)) return;
  double at_s = now_s + setup_.reply_s + (faulty(FaultKind::late, now_s) ? 0.150 : 0.0);
  if (faulty(FaultKind::garbage, now_s) && random_.chance(0.3)) {
    std::string noise(1 + static_cast<std::size_t>(random_.uniform() * 20), ' ');
    for (char& c : noise) c = static_cast<char>(static_cast<unsigned char>(random_.uniform() * 256));
    const auto at = static_cast<std::size_t>(random_.uniform() * static_cast<double>(bytes.size()));
    bytes = random_.chance(0.5) ? noise + bytes : bytes.substr(0, at) + noise + bytes.substr(at);
  }
  if (!replies_.empty()) at_s = std::max(at_s, replies_.back().at_s);
  replies_.push_back({at_s, std::move(bytes), range});
}

Bytes PozyxTag::call(const Command& command, double now_s) {
  PozyxDevice::Answer answer;
  if (faulty(FaultKind::refuse, now_s)) {
    answer.accepted = false;
  } else if (command.address == fn::tx_data) {
    answer.accepted = !command.data.empty() && command.data[0] + command.data.size() - 1 <= k_tx_buffer;
    if (answer.accepted) {
      std::copy(command.data.begin() + 1, command.data.end(), tx_.begin() + command.data[0]);
      tx_size_ = command.data[0] + command.data.size() - 1;
    }
  } else if (command.address == fn::rx_data) {
    answer.accepted = command.data.size() == 2 && command.data[0] + command.data[1] <= 100;
    if (answer.accepted)
      answer.result.assign(rx_.begin() + command.data[0], rx_.begin() + command.data[0] + command.data[1]);
    rx_unread_ = false;
  } else if (command.address == fn::positioning_with_data) {
    answer = position_with_data(command.data);
  } else if (auto plain = self_.call(command.address, command.data)) {
    answer = std::move(*plain);
  } else {
    answer.accepted = start(command.address, command.data, now_s);
  }
  Bytes out{static_cast<std::uint8_t>(answer.accepted ? 1 : 0)};
  out.insert(out.end(), answer.result.begin(), answer.result.end());
  if (out.size() > command.count) out.resize(command.count);
  return out;  // fewer than asked where the function refuses or has no more
}

bool PozyxTag::start(std::uint8_t function, ByteView parameters, double now_s) {
  switch (function) {
    case fn::reset:
      self_.reset();
      boot_s_ = now_s;
      return true;
    case fn::do_ranging:
      if (parameters.size() != 2 || u16_at(parameters, 0) == 0) {
        self_.fail(0x0d);
        return false;
      }
      range_local(u16_at(parameters, 0), now_s);
      return true;
    case fn::do_positioning:
      return position(now_s);
    case fn::devices_discover:
      return discover(parameters, now_s);
    case fn::devices_calibrate:
      // The maker's own calibration is a baseline nobody here uses: it ends, and changes nothing.
      after(now_s + 2.0, [this](double) { self_.raise(event::func); });
      return true;
    case fn::tx_send:
      return send(parameters, now_s);
    default:
      self_.fail(0x0d);
      return false;
  }
}

void PozyxTag::range_local(std::uint16_t to, double now_s) {
  ++exchanges_;
  if (faulty(FaultKind::no_event, now_s)) return;
  const double took_s = air_s(self_);
  after(now_s + took_s, [this, to, took_s](double at_s) {
    if (faulty(FaultKind::stale, at_s)) return self_.raise(event::func);
    PozyxDevice* other = device(to);
    const auto measured = other ? exchange(self_, *other, at_s - 0.4 * took_s) : std::nullopt;
    if (!measured) return self_.fail(0x12);
    Exchange result = *measured;
    if (faulty(FaultKind::zero, at_s)) result.distance_m = 0;
    store_range(self_, to, result, at_s - 0.4 * took_s);
    self_.set_impulse(simulate_impulse(result, scenario_->impulse, random_));
    fresh_ = true;
    self_.raise(event::func);
  });
}

bool PozyxTag::discover(ByteView parameters, double now_s) {
  const int type = parameters.empty() ? 0 : parameters[0];
  const int slots = parameters.size() > 1 ? parameters[1] : 3;
  const int slot_ms = parameters.size() > 2 && parameters[2] > 0 ? parameters[2] : 10;
  if (type > 2) return false;
  after(now_s + 0.001 * slot_ms * (slots + 10), [this, type](double at_s) {
    for (auto& [id, other] : others_) {
      // Random slots: answers collide, so some devices are missed each time.
      const bool heard = exchange(self_, other, at_s).has_value() && random_.chance(0.85);
      if (type != 1 && heard) self_.remember({id, true, Bytes(12)});
    }
    self_.raise(event::func);
  });
  return true;
}

bool PozyxTag::position(double now_s) {
  const auto anchors = std::count_if(self_.list().begin(), self_.list().end(),
                                     [](const PozyxDevice::Known& known) { return known.anchor; });
  after(now_s + 4 * air_s(self_), [this, anchors](double at_s) {
    if (anchors < 4) return self_.fail(0x0a);
    // The tag's own positioning is not simulated beyond its error: truth and a decimetre of noise.
    const Eigen::Vector3d at_m = terminal(self_, at_s).enu_m + 0.1 * random_.normal3();
    Bytes mm;
    for (const double metres : at_m)
      put_u32(mm, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(metres * 1000))));
    self_.set_bytes(reg::pos_x, mm);
    self_.raise(event::pos);
  });
  return true;
}

/// Newer firmware: what DO_POSITIONING found, by flags. Bit 0 the position and its status, bit 15 the number
/// of ranges used (none are told); sensors are not simulated here.
PozyxDevice::Answer PozyxTag::position_with_data(ByteView parameters) {
  PozyxDevice::Answer answer;
  const unsigned flags = parameters.size() == 2 ? u16_at(parameters, 0) : 0u;
  answer.accepted = setup_.firmware > 0x11 && (flags & 0x7ffe) == 0 && flags != 0;
  if (!answer.accepted) {
    self_.fail(0x0d);
    return answer;
  }
  if (flags & 1) {
    answer.result = self_.read(reg::pos_x, 12);
    answer.result.push_back(1);  // a valid one
  }
  if (flags & 0x8000) answer.result.push_back(0);
  return answer;
}

bool PozyxTag::send(ByteView parameters, double now_s) {
  if (parameters.size() != 3) return false;
  const std::uint16_t to = u16_at(parameters, 0);
  Bytes message{parameters[2]};
  message.insert(message.end(), tx_.begin(), tx_.begin() + static_cast<std::ptrdiff_t>(tx_size_));
  tx_size_ = 0;
  after(now_s + 0.5 * air_s(self_), [this, to, message](double at_s) {
    PozyxDevice* other = device(to);
    const bool deaf = faulty(FaultKind::remote_deaf, at_s);
    if (!other || deaf || !exchange(self_, *other, at_s)) return self_.fail(0x17);
    answer_remote(*other, message, at_s);
  });
  return true;
}

void PozyxTag::answer_remote(PozyxDevice& other, Bytes message, double now_s) {
  Bytes answer;
  std::uint8_t events = event::func;
  switch (message[0]) {
    case remote::read:  // address, count
      if (message.size() >= 3)
        answer = other.read(message[1], std::min<std::size_t>(message[2], k_tx_buffer));
      events |= event::rx_data;
      break;
    case remote::write:  // address, data
      if (message.size() >= 2) other.write(message[1], ByteView(message).subspan(2));
      break;
    case remote::function: {  // function, parameters
      return remote_function(other, ByteView(message), now_s);
    }
    default:  // data for the other device's user: acknowledged
      break;
  }
  if (!answer.empty()) {
    std::copy(answer.begin(), answer.end(), rx_.begin());
    Bytes header;
    put_u16(header, other.id());
    header.push_back(static_cast<std::uint8_t>(answer.size()));
    self_.set_bytes(reg::rx_network_id, header);
  }
  self_.raise(events);
}

namespace {

struct Pushed {
  Bytes header, data;
};
Pushed pushed(std::uint16_t from, Bytes data) {
  Pushed out;
  put_u16(out.header, from);
  out.header.push_back(static_cast<std::uint8_t>(data.size()));
  out.data = std::move(data);
  return out;
}

}  // namespace

void PozyxTag::remote_function(PozyxDevice& other, ByteView message, double now_s) {
  if (message.size() < 2) return self_.fail(0x0d);
  const std::uint8_t function = message[1];
  const Bytes parameters(message.begin() + 2, message.end());
  const auto push = [this](const Pushed& message_in, std::uint8_t events) {
    std::copy(message_in.data.begin(), message_in.data.end(), rx_.begin());
    self_.set_bytes(reg::rx_network_id, message_in.header);
    self_.raise(events);
  };
  Bytes answer{1};
  if (auto plain = other.call(function, parameters)) {
    answer[0] = plain->accepted ? 1 : 0;
    answer.insert(answer.end(), plain->result.begin(), plain->result.end());
    if (answer.size() > k_tx_buffer) answer.resize(k_tx_buffer);
  } else if (function == fn::reset) {
    other.reset();
  } else if (function == fn::do_ranging && parameters.size() == 2) {
    ++exchanges_;
    const std::uint16_t to = u16_at(parameters, 0), from = other.id();
    const double took_s = air_s(other);
    // The buffer holds one message: the result waits until the acknowledgement was read, though not for ever.
    // Clients need some 10 ms for that, about as long as the fastest exchange lasts.
    constexpr double k_patience_s = 0.1, k_look_s = 0.002;
    rx_unread_ = true;
    rx_full_until_s_ = now_s + took_s + k_patience_s;
    const auto range = [this, to, from, took_s, push](double at_s) {
      PozyxDevice *a = device(from), *b = device(to);
      const auto measured = a && b ? exchange(*a, *b, at_s - 0.4 * took_s) : std::nullopt;
      if (!measured) return;  // the remote device has an error; nothing is pushed
      store_range(*a, to, *measured, at_s - 0.4 * took_s);
      Bytes distance;
      put_u32(distance, a->ranges()[to].distance_mm);
      push(pushed(from, distance), event::rx_data);
    };
    after(now_s + took_s, [this, range](double at_s) { when_read(at_s, k_look_s, range); });
  } else {
    answer[0] = 0;
  }
  push(pushed(other.id(), answer), event::func);
}

void PozyxTag::when_read(double at_s, double look_s, const std::function<void(double)>& done) {
  if (!rx_unread_ || at_s >= rx_full_until_s_) return done(at_s);
  after(at_s + look_s, [this, look_s, done](double later_s) { when_read(later_s, look_s, done); });
}

std::optional<Exchange> PozyxTag::exchange(PozyxDevice& from, PozyxDevice& to, double at_s) {
  auto result = simulate_exchange(scenario_->world, scenario_->radio, terminal(from, at_s),
                                  terminal(to, at_s), random_);
  if (from.air() != to.air() || &from == &to) return std::nullopt;
  return result;
}

void PozyxTag::store_range(PozyxDevice& from, std::uint16_t to, const Exchange& exchange, double at_s) {
  from.ranges()[to] = {clock_ms(from, at_s),
                       static_cast<std::uint32_t>(std::lround(exchange.distance_m * 1000)),
                       static_cast<std::int16_t>(std::lround(exchange.rss_dbm))};
  if (!from.list_has(to)) from.remember({to, true, Bytes(12)});
}

PozyxDevice* PozyxTag::device(std::uint16_t id) {
  if (id == self_.id()) return &self_;
  const auto found = others_.find(id);
  return found == others_.end() ? nullptr : &found->second;
}

Terminal PozyxTag::terminal(const PozyxDevice& of, double at_s) const {
  if (&of == &self_) {
    const Pose pose = where_(at_s);
    return {pose.enu_m + pose.enu_from_body() * setup_.lever_arm_m, pose.heading_rad, 0};
  }
  for (const WorldAnchor& anchor : scenario_->world.anchors) {
    if (short_id(anchor.id) == of.id()) return {anchor.enu_m, {}, bias_m_.at(of.id())};
  }
  return {};
}

std::uint32_t PozyxTag::clock_ms(const PozyxDevice& of, double at_s) const {
  const double since_s = &of == &self_ ? at_s - boot_s_ : at_s;
  return static_cast<std::uint32_t>(std::max(0.0, since_s * (1 + 1e-6 * setup_.clock_drift_ppm) * 1000.0));
}

double PozyxTag::air_s(const PozyxDevice& of) const { return setup_.range_s.value_or(of.exchange_s()); }

void PozyxTag::update_sensors(double now_s) {
  if (self_.register_value(reg::sensors_mode) < 8) return;
  constexpr double k_turn = 2 * std::numbers::pi;
  double heading = std::fmod(where_(now_s).heading_rad, k_turn);
  if (heading < 0) heading += k_turn;
  self_.set_i16(reg::euler, std::min(heading / k_turn * 360 * 16, 5759.0));
}

int PozyxTag::flashes(NetworkId id) const {
  if (short_id(id) == self_.id()) return self_.flashes();
  const auto found = others_.find(short_id(id));
  return found == others_.end() ? 0 : found->second.flashes();
}

void PozyxTag::after(double at_s, std::function<void(double)> done) {
  pending_.push_back({at_s, std::move(done)});
}

void PozyxTag::run_until(double now_s) {
  for (;;) {
    const auto first = std::min_element(pending_.begin(), pending_.end(),
                                        [](const Pending& a, const Pending& b) { return a.at_s < b.at_s; });
    if (first == pending_.end() || first->at_s > now_s) return;
    const Pending due = std::move(*first);
    pending_.erase(first);
    due.done(due.at_s);
  }
}

std::string PozyxTag::speak(double now_s) {
  run_until(now_s);
  std::string out;
  while (!replies_.empty() && replies_.front().at_s <= now_s) {
    out += replies_.front().bytes;
    told_ += replies_.front().range;
    replies_.pop_front();
  }
  return out;
}

std::optional<double> PozyxTag::next_s() const {
  std::optional<double> next;
  if (!replies_.empty()) next = replies_.front().at_s;
  return next;  // events on the air wait for a question: nobody sees them before
}

}  // namespace anchord::sim
