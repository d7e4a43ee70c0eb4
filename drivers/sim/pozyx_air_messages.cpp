// What one simulated device sends another: registers read and written, functions called, data for its user.

#include <algorithm>
#include <utility>

#include "drivers/pozyx/registers.hpp"
#include "drivers/sim/pozyx_air.hpp"

namespace anchord::sim {

using namespace pozyx;

bool PozyxAir::send(PozyxStation& self, ByteView parameters, double now_s) {
  if (parameters.size() != 3) return false;
  const std::uint16_t to = u16_at(parameters, 0);
  const std::uint8_t operation = parameters[2];
  const bool known = operation == remote::read || operation == remote::write || operation == remote::data ||
                     operation == remote::function;
  if (!known || (to == 0 && operation == remote::read)) return false;
  const ByteView buffer = self.device.message();
  const Bytes message(buffer.begin(), buffer.end());
  after(self, now_s + 0.5 * air_s(self), [this, &self, to, operation, message](double at_s) {
    if (to == 0) return broadcast(self, operation, message, at_s);
    PozyxStation* other = find(to);
    const bool deaf = faulty(self, FaultKind::remote_deaf, at_s);
    const auto heard = other && !deaf ? exchange(self, *other, at_s, self.random) : std::nullopt;
    if (!heard) return self.device.fail(0x17);
    self.device.set_impulse(simulate_impulse(*heard, scenario_->impulse, other->random));
    deliver(*other, self, operation, message, at_s);
  });
  return true;
}

/// Id 0 is everybody; nobody acknowledges, so that it is over with the frame.
void PozyxAir::broadcast(PozyxStation& self, std::uint8_t operation, const Bytes& message, double now_s) {
  for (auto& [label, other] : stations_) {
    if (&other == &self || !exchange(self, other, now_s, self.random)) continue;
    if (operation == remote::data) {
      other.device.receive(self.device.id(), message, event::rx_data);
    } else if (message.size() >= 2 && operation == remote::write) {
      write(other, message[0], ByteView(message).subspan(1), now_s);
    } else if (!message.empty() && operation == remote::function) {
      (void)call(other, message[0], ByteView(message).subspan(1), now_s);
    }
  }
  self.device.raise(event::func);
}

void PozyxAir::deliver(PozyxStation& other, PozyxStation& asker, std::uint8_t operation, const Bytes& message,
                       double now_s) {
  const ByteView rest = ByteView(message).subspan(std::min<std::size_t>(1, message.size()));
  const std::uint16_t from = other.device.id();
  switch (operation) {
    case remote::read:  // address, count
      if (rest.empty()) return asker.device.fail(0x0d);
      return asker.device.receive(
          from, read(other, message[0], std::min<std::size_t>(rest[0], k_tx_buffer), now_s, false),
          event::func | event::rx_data);
    case remote::write:  // address, data
      if (message.empty() || !write(other, message[0], rest, now_s)) return asker.device.fail(0x01);
      return asker.device.raise(event::func);
    case remote::function: {  // function, parameters
      if (message.empty()) return asker.device.fail(0x0d);
      const PozyxDevice::Answer answer = call(other, message[0], rest, now_s, &asker);
      return asker.device.receive(from, answer.with_status(), event::func);
    }
    default:  // data for whoever sits at the other device
      other.device.receive(asker.device.id(), message, event::rx_data);
      asker.device.raise(event::func);
  }
}

void PozyxAir::when_read(PozyxStation& asker, double at_s, const std::function<void(double)>& done) {
  constexpr double k_look_s = 0.002;
  if (!asker.device.unread() || at_s >= asker.rx_full_until_s) return done(at_s);
  after(asker, at_s + k_look_s, [this, &asker, done](double later_s) { when_read(asker, later_s, done); });
}

}  // namespace anchord::sim
