#include <boost/asio/ip/udp.hpp>

#include "drivers/link/stream_link.hpp"

namespace anchord::link {
namespace {

using udp = asio::ip::udp;

class UdpLink final : public ByteLink {
 public:
  UdpLink(asio::io_context& io, Address address, const LinkOptions& options)
      : state_(std::make_shared<State>(io, std::move(address), options)) {}
  ~UdpLink() override { UdpLink::close(); }

  void open(LinkHandlers handlers) override {
    state_->shared->handlers = std::move(handlers);
    if (const auto why = state_->prepare()) {
      asio::post(state_->io, [state = state_, why = *why] { state->shared->lost(why); });
      return;
    }
    asio::post(state_->io, [state = state_] {
      if (state->shared->closed) return;
      state->shared->opened();
      if (!state->shared->closed) state->read();
    });
  }

  Result<void> write(std::string_view bytes) override { return state_->write(bytes); }

  void close() override {
    state_->shared->closed = true;
    state_->shared->open = false;
    ErrorCode ignored;
    state_->socket.close(ignored);
  }
  bool is_open() const override { return state_->shared->open; }
  LinkCounters counters() const override { return state_->shared->counters; }
  std::uint16_t port() const override { return state_->address.port; }

 private:
  struct State : std::enable_shared_from_this<State> {
    State(asio::io_context& context, Address where, const LinkOptions& options)
        : io(context),
          address(std::move(where)),
          socket(context),
          queue(options.write_queue_bytes),
          shared(std::make_shared<Shared>()) {
      shared->options = options;
    }

    /// An address with a host is where we send; a loopback host without an answer yet costs nothing.
    std::optional<Error> prepare() {
      ErrorCode error;
      const auto host = asio::ip::make_address(address.host.empty() ? "127.0.0.1" : address.host, error);
      if (error) {
        return make_error(Errc::invalid_argument,
                          to_string(address) + ": the host must be a numeric address");
      }
      udp::endpoint local(host, address.port);
      fixed = !address.host.empty() && !host.is_unspecified();
      if (fixed) {
        remote = local;
        local = udp::endpoint(local.protocol(), 0);
      }
      socket.open(local.protocol(), error);
      if (!error) socket.bind(local, error);
      if (error == asio::error::address_in_use) {
        return make_error(Errc::conflict, to_string(address) + ": busy: another program has this port");
      }
      if (error) return make_error(Errc::link_lost, to_string(address) + ": " + error.message());
      socket.non_blocking(true, error);
      if (!fixed) address.port = socket.local_endpoint(error).port();
      return std::nullopt;
    }

    void read() {
      socket.async_receive_from(
          asio::buffer(buffer), sender, [self = shared_from_this()](ErrorCode error, std::size_t n) {
            if (self->shared->closed) return;
            if (!error && self->welcome({self->buffer.data(), n}))
              self->shared->took({self->buffer.data(), n});
            if (self->shared->closed) return;
            // "Connection refused" is the echo of a datagram that nobody took: the device may come yet.
            if (error && error != asio::error::connection_refused && error != asio::error::message_size) {
              return self->shared->lost(ended(self->address, error, false));
            }
            self->read();
          });
    }

    bool welcome(std::string_view bytes) {
      if (fixed && sender != *remote) return false;
      const auto& judge = shared->handlers.welcome;
      if (judge && !judge(bytes, name_of(sender), arrival_now())) return false;
      remote = sender;
      return true;
    }

    static std::string name_of(const udp::endpoint& who) {
      const std::string host = who.address().to_string();
      return (who.address().is_v6() ? '[' + host + ']' : host) + ':' + std::to_string(who.port());
    }

    Result<void> write(std::string_view bytes) {
      if (!shared->open) return make_error(Errc::link_lost, "the socket is not open");
      if (!remote) return make_error(Errc::link_lost, "nothing has been received yet");
      const bool idle = queue.empty();
      if (!queue.push(bytes)) {
        ++shared->counters.writes_refused;
        return make_error(Errc::queue_full, "the network does not accept the data that is sent");
      }
      if (idle && !queue.empty()) send();
      return boost::outcome_v2::success();
    }

    void send() {
      socket.async_send_to(
          asio::buffer(queue.front()), *remote, [self = shared_from_this()](ErrorCode, std::size_t n) {
            self->shared->counters.bytes_out += n;
            if (self->shared->closed) return;
            self->queue.pop();  // a datagram that could not leave is lost, as any datagram may be
            if (!self->queue.empty()) self->send();
          });
    }

    asio::io_context& io;
    Address address;
    udp::socket socket;
    udp::endpoint sender;
    std::optional<udp::endpoint> remote;
    bool fixed{false};
    WriteQueue queue;
    std::shared_ptr<Shared> shared;
    std::array<char, 65'536> buffer{};
  };

  std::shared_ptr<State> state_;
};

}  // namespace

std::unique_ptr<ByteLink> make_udp_link(asio::io_context& io, const Address& address,
                                        const LinkOptions& options) {
  return std::make_unique<UdpLink>(io, address, options);
}

}  // namespace anchord::link
