#include "server/flight/drone_link.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "drivers/drone/peer_gate.hpp"
#include "drivers/drone/session.hpp"
#include "drivers/link/byte_link.hpp"

namespace anchord::flight {
namespace {

namespace asio = boost::asio;
constexpr auto k_round = std::chrono::milliseconds(50);
constexpr int k_rounds_to_reopen = 20;
constexpr std::int64_t k_write_ms = 1'500;

double seconds(const link::Arrival& at) { return static_cast<double>(at.steady_ns) * 1e-9; }

/// Who may speak, and what is said: of the link's thread and of whoever commands.
struct Dialogue {
  explicit Dialogue(const std::optional<mavlink::Secret>& key) : gate(key), session(options_with(key)) {}

  static drone::SessionOptions options_with(const std::optional<mavlink::Secret>& key) {
    drone::SessionOptions out;
    out.secret = key;
    return out;
  }

  drone::PeerGate gate;
  drone::Session session;
  std::string link_fault;  ///< why the link is closed; empty: it is open
};

}  // namespace

struct DroneLink::Impl {
  Impl(link::Address where, std::function<void(std::string_view)> tell,
       const std::optional<mavlink::Secret>& key)
      : address(std::move(where)),
        log(std::move(tell)),
        timer(io),
        dialogue(std::in_place, key),
        is_signed(key.has_value()) {}

  void run() {
    (void)guarded("aircraft", [this] { open(); });
    round();
    run_guarded("aircraft", io);
  }

  static std::span<const std::uint8_t> bytes_of(std::string_view in) {
    return {reinterpret_cast<const std::uint8_t*>(in.data()), in.size()};
  }

  /// Where it listens, where an aircraft on the network could not be received.
  std::string reach() const {
    const bool here = address.kind == link::Kind::udp && address.host.empty();
    if (!here) return {};
    return "the link is open to this machine alone (" + link::to_string(address) +
           "); for an aircraft on the network: udp://0.0.0.0:PORT with a signing key";
  }

  /// Told once, who it is and who it is no longer.
  bool admits(std::string_view in, const std::string& sender, const link::Arrival& at) {
    std::string told;
    bool admitted = false;
    {
      auto now = dialogue.lock();
      const auto before = now->gate.peer();
      admitted = now->gate.admits(seconds(at), at.utc.us(), sender, bytes_of(in));
      if (now->gate.peer() != before && !sender.empty()) told = "the aircraft on the link is at " + sender;
    }
    if (log && !told.empty()) log(told);
    return admitted;
  }

  void open() {
    closed_for = 1;  // what throws here is tried again
    // A stream that does not take what is sent is closed: what waited in it must not come out minutes later.
    link::LinkOptions options;
    options.write_deadline_ms = k_write_ms;
    bytes = link::make_link(io, address, options);
    link::LinkHandlers handlers;
    handlers.welcome = [this](std::string_view in, const std::string& sender, const link::Arrival& at) {
      bool welcome = false;
      (void)guarded("aircraft", [&] { welcome = admits(in, sender, at); });
      return welcome;
    };
    handlers.on_bytes = [this](std::string_view in, const link::Arrival& at) {
      // Guarded here, so that the link reads on after a frame that we cannot bear.
      (void)guarded("aircraft", [&] {
        const bool judged = address.kind == link::Kind::udp || address.kind == link::Kind::tcp_listen;
        if (!judged && !admits(in, "", at)) return;
        auto now = dialogue.lock();
        now->link_fault.clear();
        now->session.feed(seconds(at), at.utc.us(), bytes_of(in));
      });
    };
    handlers.on_closed = [this](const Error& why) {
      if (log && why.message != last_trouble) log("aircraft: " + why.message);
      last_trouble = why.message;
      closed_for = 1;
      auto now = dialogue.lock();
      now->link_fault = why.message;
    };
    closed_for = 0;
    bytes->open(std::move(handlers));
  }

  /// The next round comes whatever happens in this one: without it no heartbeat and no command would leave.
  void round() {
    (void)guarded("aircraft", [this] { talk(); });
    timer.expires_after(k_round);
    timer.async_wait([this](const boost::system::error_code& error) {
      if (!error) round();
    });
  }

  void talk() {
    if (closed_for > 0 && ++closed_for > k_rounds_to_reopen) open();
    const auto now = link::arrival_now();
    {
      auto talking = dialogue.lock();
      if (address.kind == link::Kind::tcp_listen && bytes && !bytes->is_open()) talking->gate.closed();
      talking->session.tick(seconds(now), now.utc.us());
    }
    write();
  }

  /// What the session has to say. Taken and written by the link's thread alone, so that frames leave in the
  /// order in which they were numbered and signed: of two that change places the autopilot ignores the older.
  /// What cannot leave is lost, as on any radio; the session repeats it or says that it was not confirmed.
  void write() {
    std::vector<std::uint8_t> out;
    {
      auto now = dialogue.lock();
      out = now->session.take_bytes();
    }
    if (!out.empty() && closed_for == 0)
      (void)bytes->write({reinterpret_cast<const char*>(out.data()), out.size()}).has_value();
  }

  template <class Call>
  std::uint64_t command(Call call) {
    std::uint64_t number = 0;
    {
      auto now = dialogue.lock();
      number = call(now->session);
    }
    asio::post(io, [this] { (void)guarded("aircraft", [this] { write(); }); });
    return number;
  }

  link::Address address;
  std::function<void(std::string_view)> log;
  asio::io_context io;
  asio::steady_timer timer;
  std::unique_ptr<link::ByteLink> bytes;
  int closed_for{0};  ///< rounds since the link was lost; 0: it is open or opening
  std::string last_trouble;
  Locked<Dialogue> dialogue;
  bool is_signed{false};
  Thread thread;
};

Result<std::unique_ptr<DroneLink>> DroneLink::open(const std::string& address,
                                                   std::function<void(std::string_view)> log,
                                                   const std::optional<mavlink::Secret>& key) {
  BOOST_OUTCOME_TRY(auto where, link::parse_address(address));
  return std::unique_ptr<DroneLink>(
      new DroneLink(std::make_unique<Impl>(std::move(where), std::move(log), key)));
}

DroneLink::DroneLink(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DroneLink::~DroneLink() {
  // Posted after the last command's bytes, so that a farewell hold still leaves.
  asio::post(impl_->io, [this] { impl_->io.stop(); });
  if (impl_->thread.joinable()) impl_->thread.join();
}

void DroneLink::start() {
  impl_->thread = Thread("anchord-drone", [running = impl_.get()] { running->run(); });
}

void DroneLink::new_flight(double speed_mps) {
  impl_->command([&](drone::Session& s) {
    s.new_flight(speed_mps);
    return 0U;
  });
}
void DroneLink::end_flight() {
  impl_->command([](drone::Session& s) {
    s.end_flight();
    return 0U;
  });
}
std::uint64_t DroneLink::take_off(double above_ground_m) {
  return impl_->command([&](drone::Session& s) { return s.take_off(above_ground_m); });
}
void DroneLink::steer(double lat_deg, double lon_deg, double height_m) {
  impl_->command([&](drone::Session& s) {
    s.steer(lat_deg, lon_deg, height_m);
    return 0U;
  });
}
std::uint64_t DroneLink::disarm() {
  return impl_->command([](drone::Session& s) { return s.disarm(); });
}
void DroneLink::ask_parameters(const std::vector<std::string>& names) {
  auto now = impl_->dialogue.lock();
  now->session.ask_parameters(names);
}
std::uint64_t DroneLink::go_to(double lat_deg, double lon_deg, double height_m,
                               std::optional<double> heading_deg) {
  return impl_->command([&](drone::Session& s) { return s.go_to(lat_deg, lon_deg, height_m, heading_deg); });
}
std::uint64_t DroneLink::hold() {
  return impl_->command([](drone::Session& s) { return s.hold(); });
}
std::uint64_t DroneLink::return_home() {
  return impl_->command([](drone::Session& s) { return s.return_home(); });
}
std::uint64_t DroneLink::land() {
  return impl_->command([](drone::Session& s) { return s.land(); });
}
std::uint64_t DroneLink::upload_route(const std::vector<RoutePoint>& route) {
  return impl_->command([&](drone::Session& s) { return s.upload_route(route); });
}
std::uint64_t DroneLink::upload_fence(const DroneFence& fence) {
  return impl_->command([&](drone::Session& s) { return s.upload_fence(fence); });
}
void DroneLink::take_back() {
  auto now = impl_->dialogue.lock();
  now->session.take_back();
}
void DroneLink::change_peer(const std::string& sender) {
  auto now = impl_->dialogue.lock();
  now->gate.change(sender);
  now->session.forget_vehicle();
}
void DroneLink::expect(const DroneIdentity& aircraft) {
  auto now = impl_->dialogue.lock();
  now->gate.expect(seconds(link::arrival_now()), aircraft);
  now->session.expect_vehicle(now->gate.vehicle());
}
DroneStatus DroneLink::status() const {
  auto now = impl_->dialogue.lock();
  DroneStatus out = now->session.status();
  out.identity.peer = now->gate.peer().value_or("");
  out.link_signed = impl_->is_signed;
  out.frames_refused = now->gate.frames_refused();
  const double now_s = seconds(link::arrival_now());
  out.others = now->gate.others(now_s);
  if (out.link_trouble.empty()) out.link_trouble = now->gate.trouble(now_s, out.connected);
  if (!out.connected) out.link_fault = now->link_fault.empty() ? impl_->reach() : now->link_fault;
  return out;
}
std::vector<CommandReport> DroneLink::take_reports() {
  auto now = impl_->dialogue.lock();
  return now->session.take_reports();
}

}  // namespace anchord::flight
