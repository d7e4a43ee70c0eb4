#include "drivers/sim/pozyx_tag.hpp"

#include <algorithm>
#include <utility>

#include "drivers/pozyx/registers.hpp"

namespace anchord::sim {

using namespace pozyx;

PozyxTag::PozyxTag(std::shared_ptr<const Scenario> scenario, const TagSetup& tag, Whereabouts where)
    : PozyxTag(std::make_shared<PozyxAir>(std::move(scenario), std::move(where)), tag) {}

PozyxTag::PozyxTag(std::shared_ptr<PozyxAir> air, const TagSetup& tag)
    : air_(std::move(air)), self_(&air_->tag(tag.id)) {}

void PozyxTag::power_up(double now_s) {
  air_->run_until(now_s);
  opened();
  air_->restart(*self_, now_s);
}

void PozyxTag::opened() {
  replies_.clear();
  lines_.clear();
}

void PozyxTag::receive(std::string_view bytes, double now_s) {
  air_->run_until(now_s);
  lines_.feed(bytes);
  while (const auto line = lines_.next()) {
    // What a tag says to an unknown or broken command is not known: silence, which a host must bear anyway.
    if (const auto command = parse_command(*line)) take(command.value(), now_s);
  }
}

void PozyxTag::take(const Command& command, double now_s) {
  switch (command.kind) {
    case Command::Kind::write:
      air_->write(*self_, command.address, command.data, now_s);
      return;
    case Command::Kind::read:
      return send(reply_line(air_->read(*self_, command.address, command.count, now_s, true)), now_s);
    case Command::Kind::function: {
      const Bytes answer = call(command, now_s);
      const bool range = command.address == fn::device_get_range_info && !answer.empty() &&
                         answer.front() == 1 && std::exchange(self_->fresh, false);
      return send(reply_line(answer), now_s, range);
    }
  }
}

void PozyxTag::send(std::string bytes, double now_s, bool range) {
  const auto faulty = [&](FaultKind kind) { return air_->faulty(*self_, kind, now_s); };
  if (faulty(FaultKind::silence)) return;
  double at_s = now_s + self_->setup.reply_s + (faulty(FaultKind::late) ? 0.150 : 0.0);
  Random& random = self_->random;
  if (faulty(FaultKind::garbage) && random.chance(0.3)) {
    std::string noise(1 + static_cast<std::size_t>(random.uniform() * 20), ' ');
    for (char& c : noise) c = static_cast<char>(static_cast<unsigned char>(random.uniform() * 256));
    const auto at = static_cast<std::size_t>(random.uniform() * static_cast<double>(bytes.size()));
    bytes = random.chance(0.5) ? noise + bytes : bytes.substr(0, at) + noise + bytes.substr(at);
  }
  if (!replies_.empty()) at_s = std::max(at_s, replies_.back().at_s);
  replies_.push_back({at_s, std::move(bytes), range});
}

Bytes PozyxTag::call(const Command& command, double now_s) {
  PozyxDevice::Answer answer;
  if (air_->faulty(*self_, FaultKind::refuse, now_s)) {
    answer.accepted = false;
  } else {
    answer = air_->call(*self_, command.address, command.data, now_s);
  }
  // As many bytes as were asked for: hosts ask for whole lists and for more ranges than there are, and find
  // zeros after the last. Only a refusal is short.
  Bytes out = answer.with_status();
  if (answer.accepted || out.size() > command.count) out.resize(command.count);
  return out;
}

int PozyxTag::flashes(NetworkId id) const {
  const PozyxStation* found = air_->by_label(id);
  return found ? found->device.flashes() : 0;
}

std::string PozyxTag::speak(double now_s) {
  air_->run_until(now_s);
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
