#include <algorithm>
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <vector>

#include "drivers/link/stream_link.hpp"

namespace anchord::link {
namespace {

using tcp = asio::ip::tcp;

/// A device that vanished without a word is noticed by the kernel within about half a minute even when we
/// only read; the supervisor's silence is quicker.
void keep_alive(tcp::socket& socket) {
  ErrorCode ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
  socket.set_option(asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPIDLE>(10), ignored);
  socket.set_option(asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPINTVL>(5), ignored);
  socket.set_option(asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPCNT>(3), ignored);
}

class TcpLink : public ByteLink {
 public:
  TcpLink(asio::io_context& io, Address address, const LinkOptions& options)
      : io_(io), state_(std::make_shared<State>(io, std::move(address))) {
    state_->shared->options = options;
  }
  ~TcpLink() override { TcpLink::close(); }

  void open(LinkHandlers handlers) override {
    state_->shared->handlers = std::move(handlers);
    state_->begin();
  }

  Result<void> write(std::string_view bytes) override {
    if (!state_->shared->open || !state_->pump) return make_error(Errc::link_lost, "not connected");
    return state_->pump->write(bytes);
  }

  void close() override {
    state_->shared->closed = true;
    state_->shared->open = false;
    state_->stop();
  }
  bool is_open() const override { return state_->shared->open; }
  LinkCounters counters() const override { return state_->shared->counters; }
  std::uint16_t port() const override { return state_->address.port; }

 private:
  struct State : std::enable_shared_from_this<State> {
    State(asio::io_context& io, Address where)
        : address(std::move(where)),
          resolver(io),
          socket(io),
          deadline(io),
          shared(std::make_shared<Shared>()) {}

    void begin() {
      deadline.expires_after(std::chrono::milliseconds(shared->options.open_deadline_ms));
      deadline.async_wait([self = shared_from_this()](ErrorCode error) {
        if (error || self->shared->open || self->shared->closed) return;
        self->fail(
            make_error(Errc::link_lost, to_string(self->address) + ": no answer: is it on this network?"));
      });
      resolver.async_resolve(
          address.host, std::to_string(address.port),
          [self = shared_from_this()](ErrorCode error, const tcp::resolver::results_type& found) {
            if (self->shared->closed) return;
            if (error) {
              return self->fail(make_error(Errc::not_found, to_string(self->address) + ": no such host"));
            }
            self->connect(found);
          });
    }

    void connect(const tcp::resolver::results_type& found) {
      asio::async_connect(socket, found, [self = shared_from_this()](ErrorCode error, const tcp::endpoint&) {
        if (self->shared->closed) return;
        if (error) return self->fail(ended(self->address, error, false));
        self->deadline.cancel();
        keep_alive(self->socket);
        self->pump = std::make_shared<Pump<tcp::socket>>(
            std::move(self->socket), self->shared,
            [shared = self->shared, where = self->address](const ErrorCode& why, bool late) {
              shared->lost(ended(where, why, late));
            });
        const auto pump_now = self->pump;
        self->shared->opened();
        if (!self->shared->closed) pump_now->start();
      });
    }

    void fail(const Error& why) {
      stop();
      shared->lost(why);
    }

    void stop() {
      ErrorCode ignored;
      resolver.cancel();
      deadline.cancel();
      socket.close(ignored);
      if (const auto running = std::exchange(pump, nullptr)) running->stop();
    }

    Address address;
    tcp::resolver resolver;
    tcp::socket socket;
    asio::steady_timer deadline;
    std::shared_ptr<Shared> shared;
    std::shared_ptr<Pump<tcp::socket>> pump;
  };

  asio::io_context& io_;
  std::shared_ptr<State> state_;
};

/// Waits for the device to come. One peer at a time, and the newest whose bytes came wins: a rover that
/// rebooted is back before its old connection is known to be dead, and who only connects (a port scan) takes
/// nobody's place. While there is no peer, the first to connect is it, unless the handlers say who is
/// welcome.
class ListenLink final : public ByteLink {
 public:
  ListenLink(asio::io_context& io, Address address, const LinkOptions& options)
      : state_(std::make_shared<State>(io, std::move(address))) {
    state_->shared->options = options;
  }
  ~ListenLink() override { ListenLink::close(); }

  void open(LinkHandlers handlers) override {
    state_->shared->handlers = std::move(handlers);
    if (const auto why = state_->listen()) {
      asio::post(state_->io, [state = state_, why = *why] { state->shared->lost(why); });
      return;
    }
    state_->accept();
  }

  Result<void> write(std::string_view bytes) override {
    if (!state_->peer) return make_error(Errc::link_lost, "no device has connected yet");
    return state_->peer->write(bytes);
  }

  void close() override {
    state_->shared->closed = true;
    state_->shared->open = false;
    ErrorCode ignored;
    state_->acceptor.close(ignored);
    if (const auto peer = std::exchange(state_->peer, nullptr)) peer->stop();
    for (const auto& guest : std::exchange(state_->guests, {})) guest.pump->stop();
  }
  bool is_open() const override { return state_->shared->open; }
  LinkCounters counters() const override { return state_->counters(); }
  std::uint16_t port() const override { return state_->address.port; }

 private:
  using TcpPump = Pump<tcp::socket>;
  static constexpr std::size_t k_guests = 8;  ///< of a hostile network; the oldest goes, but never the peer

  /// A connection and who its bytes go to.
  struct Guest {
    std::shared_ptr<Shared> line;
    std::shared_ptr<TcpPump> pump;
  };

  struct State : std::enable_shared_from_this<State> {
    State(asio::io_context& context, Address where)
        : io(context), address(std::move(where)), acceptor(context), shared(std::make_shared<Shared>()) {}

    std::optional<Error> listen() {
      ErrorCode error;
      const auto host = asio::ip::make_address(address.host.empty() ? "127.0.0.1" : address.host, error);
      if (error) {
        return make_error(Errc::invalid_argument, to_string(address) + ": the bind address must be numeric");
      }
      const tcp::endpoint endpoint(host, address.port);
      acceptor.open(endpoint.protocol(), error);
      if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
      if (!error) acceptor.bind(endpoint, error);
      if (!error) acceptor.listen(4, error);
      if (error == asio::error::address_in_use) {
        return make_error(Errc::conflict, to_string(address) + ": busy: another program has this port");
      }
      if (error) return make_error(Errc::link_lost, to_string(address) + ": " + error.message());
      address.port = acceptor.local_endpoint(error).port();
      return std::nullopt;
    }

    void accept() {
      acceptor.async_accept([self = shared_from_this()](ErrorCode error, tcp::socket socket) {
        if (self->shared->closed) return;
        if (error) return self->shared->lost(ended(self->address, error, false));
        self->take(std::move(socket));
        if (!self->shared->closed) self->accept();
      });
    }

    /// Its bytes go to whoever judges them first, and to the handlers only when they were welcome.
    void take(tcp::socket socket) {
      keep_alive(socket);
      ErrorCode gone;
      const auto from = socket.remote_endpoint(gone);
      if (gone) return;
      const std::string host = from.address().to_string();
      const std::string name =
          (from.address().is_v6() ? '[' + host + ']' : host) + ':' + std::to_string(from.port());
      const auto line = std::make_shared<Shared>();
      line->options = shared->options;
      const auto guest = std::make_shared<TcpPump>(
          std::move(socket), line, [weak = weak_from_this(), of = line.get()](const ErrorCode&, bool) {
            if (const auto self = weak.lock()) self->left(of);
          });
      line->handlers.on_bytes = [weak = weak_from_this(), of = line.get(), name](std::string_view bytes,
                                                                                 const Arrival& at) {
        if (const auto self = weak.lock()) self->judge(of, bytes, name, at);
      };
      guests.push_back({line, guest});
      if (guests.size() > k_guests) {
        const auto oldest = guests.front().pump == peer ? guests.begin() + 1 : guests.begin();
        oldest->pump->stop();
        dismiss(oldest);
      }
      serve_somebody();
      if (!shared->closed) guest->start();
    }

    /// A device may wait to be asked before it says anything.
    void serve_somebody() {
      if (peer == nullptr && !guests.empty() && !shared->handlers.welcome) serve(guests.back().pump);
    }

    void serve(const std::shared_ptr<TcpPump>& guest) {
      if (const auto old = std::exchange(peer, guest)) {
        old->stop();
        dismiss(std::ranges::find(guests, old, &Guest::pump));
      }
      shared->opened();
    }

    void judge(const Shared* of, std::string_view bytes, const std::string& name, const Arrival& at) {
      const auto found = guest_of(of);
      if (shared->closed || found == guests.end()) return;
      if (shared->handlers.welcome && !shared->handlers.welcome(bytes, name, at)) return;
      if (found->pump != peer) serve(std::shared_ptr<TcpPump>(found->pump));
      if (!shared->closed) shared->took(bytes);
    }

    /// The next one may come; silence is the supervisor's business.
    void left(const Shared* of) {
      const auto found = guest_of(of);
      if (found == guests.end()) return;
      if (found->pump == peer) {
        peer = nullptr;
        shared->open = false;
      }
      dismiss(found);
      serve_somebody();
    }

    /// What it was sent stays counted.
    void dismiss(std::vector<Guest>::iterator guest) {
      add(shared->counters, guest->line->counters);
      guests.erase(guest);
    }
    static void add(LinkCounters& to, const LinkCounters& of) {
      to.bytes_out += of.bytes_out;
      to.writes_refused += of.writes_refused;
    }
    LinkCounters counters() const {
      LinkCounters all = shared->counters;
      for (const auto& guest : guests) add(all, guest.line->counters);
      return all;
    }

    std::vector<Guest>::iterator guest_of(const Shared* line) {
      return std::ranges::find_if(guests, [&](const Guest& one) { return one.line.get() == line; });
    }

    asio::io_context& io;
    Address address;
    tcp::acceptor acceptor;
    std::shared_ptr<Shared> shared;
    std::shared_ptr<TcpPump> peer;
    std::vector<Guest> guests;  ///< the peer among them; the newest last
  };

  std::shared_ptr<State> state_;
};

}  // namespace

std::unique_ptr<ByteLink> make_tcp_link(asio::io_context& io, const Address& address,
                                        const LinkOptions& options) {
  return std::make_unique<TcpLink>(io, address, options);
}
std::unique_ptr<ByteLink> make_listen_link(asio::io_context& io, const Address& address,
                                           const LinkOptions& options) {
  return std::make_unique<ListenLink>(io, address, options);
}

}  // namespace anchord::link
