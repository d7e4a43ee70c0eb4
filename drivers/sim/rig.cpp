#include "drivers/sim/rig.hpp"

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>

#include "drivers/sim/ports.hpp"
#include "drivers/sim/pozyx_tag.hpp"
#include "drivers/sim/rover.hpp"

namespace anchord::sim {
namespace {

/// One device behind its port.
class Unit {
 public:
  Unit(ServedDevice served, std::unique_ptr<Port> port)
      : served_(std::move(served)), port_(std::move(port)) {}
  virtual ~Unit() = default;
  virtual void run(double now_s) = 0;
  virtual std::optional<double> next_s() const = 0;
  virtual void powered(double now_s) = 0;
  virtual std::uint64_t told() const { return 0; }

  Result<void> up() {
    BOOST_OUTCOME_TRYV(port_->up());
    served_.pty = port_->path();
    served_.tcp_port = port_->port();
    served_.address = served_.tcp_port != 0 ? "tcp://127.0.0.1:" + std::to_string(served_.tcp_port)
                                            : "serial:" + (served_.link.empty() ? served_.pty : served_.link);
    served_.plugged = true;
    return boost::outcome_v2::success();
  }
  void down() {
    port_->down();
    served_.plugged = false;
  }
  Port& port() { return *port_; }
  const ServedDevice& served() const { return served_; }
  std::optional<bool> by_hand{};  ///< plugged by hand

 private:
  ServedDevice served_;
  std::unique_ptr<Port> port_;
};

class TagUnit final : public Unit {
 public:
  TagUnit(ServedDevice served, std::unique_ptr<Port> made, std::shared_ptr<PozyxAir> air,
          const TagSetup& setup)
      : Unit(std::move(served), std::move(made)), tag_(std::move(air), setup) {}
  void run(double now_s) override {
    if (!port().arrived().empty()) tag_.opened();
    for (const auto& heard : port().receive()) tag_.receive(heard.bytes, now_s);
    port().send_all(tag_.speak(now_s));
  }
  std::optional<double> next_s() const override { return tag_.next_s(); }
  void powered(double now_s) override { tag_.power_up(now_s); }
  std::uint64_t told() const override { return tag_.told(); }

 private:
  PozyxTag tag_;
};

class RoverUnit final : public Unit {
 public:
  RoverUnit(ServedDevice served, std::unique_ptr<Port> made, std::shared_ptr<const Scenario> scenario,
            const RoverSetup& setup, Whereabouts where, UtcTime start)
      : Unit(std::move(served), std::move(made)),
        format_(setup.format),
        rover_(std::move(scenario), setup, std::move(where), start) {}
  void run(double now_s) override {
    for (const int peer : port().arrived()) {
      port().send(peer, greeting(format_));
      watching_[peer] = format_ != RoverFormat::gpsd;
    }
    // Corrections come in on the same wire; only a gpsd is asked things.
    for (const auto& heard : port().receive()) {
      if (format_ == RoverFormat::gpsd) answer(heard.peer, heard.bytes);
    }
    const std::string bytes = rover_.speak(now_s);
    if (bytes.empty()) return;
    for (const auto& [peer, watches] : watching_) {
      if (watches) port().send(peer, bytes);
    }
  }
  std::optional<double> next_s() const override { return rover_.next_s(); }
  void powered(double now_s) override {
    watching_.clear();
    asked_.clear();
    rover_.skip_to(now_s);
  }

 private:
  void answer(int peer, const std::string& bytes) {
    auto& asked = asked_[peer];
    asked += bytes;
    for (auto end = asked.find(';'); end != std::string::npos; end = asked.find(';')) {
      std::string command = asked.substr(0, end);
      asked.erase(0, end + 1);
      command.erase(0, std::min(command.find('?'), command.size()));
      if (command.starts_with("?WATCH"))
        watching_[peer] = command.find("\"enable\":false") == std::string::npos;
      port().send(peer, gpsd_answer(command, "/dev/rover"));
    }
    if (asked.size() > 4096) asked.clear();
  }
  RoverFormat format_;
  RoverSim rover_;
  std::map<int, bool> watching_;
  std::map<int, std::string> asked_;
};

double steady_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

class Rig::Impl {
 public:
  explicit Impl(std::shared_ptr<const Scenario> scenario) : scenario_(std::move(scenario)) {}

  Result<void> build(const RigOptions& options) {
    const UtcTime now = SystemClock{}.now();
    const UtcTime start = scenario_->start.value_or(options.start.ns != 0 ? options.start : now);
    Whereabouts where = options.pilot;
    if (!where) {
      where = [path = FlightPath(scenario_->path, scenario_->speed_mps, scenario_->loop)](double time_s) {
        return path.at(time_s);
      };
    }
    const auto link_of = [&](const std::string& own, const std::string& name) {
      return !own.empty() || options.links_folder.empty() ? own : options.links_folder + "/" + name;
    };
    const auto air = std::make_shared<PozyxAir>(scenario_, where);
    for (const TagSetup& tag : scenario_->tags) {
      ServedDevice served{tag.name, "pozyx", "", "", "", link_of(tag.link, tag.name)};
      auto port = make_pty(served.link);
      units_.push_back(std::make_unique<TagUnit>(std::move(served), std::move(port), air, tag));
    }
    for (const RoverSetup& rover : scenario_->rovers) {
      const bool pty = rover.port == RoverPort::pty;
      ServedDevice served{rover.name, "gnss", std::string(to_string(rover.format)),
                          "",         "",     pty ? link_of(rover.link, rover.name) : std::string()};
      auto port = pty ? make_pty(served.link) : make_tcp(rover.tcp_port);
      units_.push_back(
          std::make_unique<RoverUnit>(std::move(served), std::move(port), scenario_, rover, where, start));
    }
    for (auto& unit : units_) {
      BOOST_OUTCOME_TRYV(unit->up());
    }
    begun_s_ = steady_s();
    return boost::outcome_v2::success();
  }

  double now_s() const { return steady_s() - begun_s_; }

  void step(int at_most_ms, int also) {
    wait(at_most_ms, also);
    const double now = now_s();
    for (auto& unit : units_) {
      plug_as_told(*unit, now);
      if (unit->served().plugged) unit->run(now);
    }
  }

  bool plug(const std::string& name, bool in) {
    for (auto& unit : units_) {
      if (unit->served().name != name) continue;
      unit->by_hand = in;
      plug_as_told(*unit, now_s());
      return true;
    }
    return false;
  }

  std::uint64_t told_ranges(const std::string& name) const {
    for (const auto& unit : units_) {
      if (unit->served().name == name) return unit->told();
    }
    return 0;
  }

  std::vector<ServedDevice> devices() const {
    std::vector<ServedDevice> out;
    for (const auto& unit : units_) out.push_back(unit->served());
    return out;
  }

  std::function<void(const ServedDevice&)> told{};

 private:
  void plug_as_told(Unit& unit, double now) {
    const bool pulled = fault_at(*scenario_, unit.served().name, FaultKind::unplug, now) != nullptr;
    const bool in = unit.by_hand.value_or(!pulled);
    if (in == unit.served().plugged) return;
    if (!in) {
      unit.down();
    } else {
      if (!unit.up()) return;  // the port is taken for a moment: tried again with the next step
      unit.powered(now);
    }
    if (told) told(unit.served());
  }

  void wait(int at_most_ms, int also) {
    std::vector<pollfd> all;
    double next_s = now_s() + at_most_ms * 1e-3;
    for (const auto& unit : units_) {
      if (!unit->served().plugged) continue;
      for (const int fd : unit->port().descriptors()) all.push_back({fd, POLLIN, 0});
      if (const auto due = unit->next_s(); due && unit->port().anybody()) next_s = std::min(next_s, *due);
      // A pty does not tell when somebody opens it.
      if (!unit->port().anybody()) next_s = std::min(next_s, now_s() + 0.005);
    }
    if (also >= 0) all.push_back({also, POLLIN, 0});
    const double left_s = std::max(0.0, next_s - now_s());
    timespec time{};
    time.tv_sec = static_cast<time_t>(left_s);
    time.tv_nsec = static_cast<long>((left_s - std::floor(left_s)) * 1e9);
    ::ppoll(all.data(), all.size(), &time, nullptr);
  }

  std::shared_ptr<const Scenario> scenario_;
  std::vector<std::unique_ptr<Unit>> units_;
  double begun_s_{};
};

Rig::Rig(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Rig::~Rig() = default;

Result<std::unique_ptr<Rig>> Rig::open(std::shared_ptr<const Scenario> scenario, RigOptions options) {
  BOOST_OUTCOME_TRYV(check(*scenario));
  auto impl = std::make_unique<Impl>(std::move(scenario));
  BOOST_OUTCOME_TRYV(impl->build(options));
  return std::unique_ptr<Rig>(new Rig(std::move(impl)));
}

void Rig::step(int at_most_ms, int also) { impl_->step(at_most_ms, also); }
double Rig::now_s() const { return impl_->now_s(); }
std::vector<ServedDevice> Rig::devices() const { return impl_->devices(); }
bool Rig::plug(const std::string& name, bool in) { return impl_->plug(name, in); }
std::uint64_t Rig::told_ranges(const std::string& name) const { return impl_->told_ranges(name); }
void Rig::on_change(std::function<void(const ServedDevice&)> told) { impl_->told = std::move(told); }

}  // namespace anchord::sim
