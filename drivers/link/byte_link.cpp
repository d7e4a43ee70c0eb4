#include "drivers/link/byte_link.hpp"

#include "drivers/link/stream_link.hpp"

namespace anchord::link {

Arrival arrival_now() {
  using std::chrono::duration_cast;
  using std::chrono::nanoseconds;
  const auto wall = std::chrono::system_clock::now().time_since_epoch();
  const auto steady = std::chrono::steady_clock::now().time_since_epoch();
  return {UtcTime{duration_cast<nanoseconds>(wall).count()}, duration_cast<nanoseconds>(steady).count()};
}

bool WriteQueue::push(std::string_view bytes) {
  if (bytes.size() > bound_ - bytes_) return false;
  if (bytes.empty()) return true;
  bytes_ += bytes.size();
  parts_.emplace_back(bytes);
  return true;
}

void WriteQueue::pop() {
  bytes_ -= parts_.front().size();
  parts_.pop_front();
}

void WriteQueue::clear() {
  parts_.clear();
  bytes_ = 0;
}

// The handlers are copied before the call: what they do may end the link, and with it themselves.
void Shared::opened() {
  if (closed) return;
  open = true;
  if (const auto call = handlers.on_open) call();
}

void Shared::took(std::string_view bytes) {
  if (closed) return;
  const auto at = arrival_now();
  counters.bytes_in += bytes.size();
  if (handlers.on_bytes) {
    const auto keep = handlers.on_bytes;
    keep(bytes, at);
  }
}

void Shared::lost(const Error& why) {
  if (closed) return;
  closed = true;
  open = false;
  const auto call = std::exchange(handlers, {}).on_closed;
  if (call) call(why);
}

Error ended(const Address& address, const ErrorCode& error, bool wrote_too_long) {
  const auto where = to_string(address) + ": ";
  if (wrote_too_long) return make_error(Errc::link_lost, where + "the device no longer accepts data");
  if (error == asio::error::eof || error == boost::system::errc::io_error) {
    return make_error(
        Errc::link_lost,
        where + (address.kind == Kind::serial ? "unplugged" : "the other side closed the connection"));
  }
  if (error == asio::error::connection_refused) {
    return make_error(Errc::not_found, where + "refused: is the service of the device switched on?");
  }
  return make_error(Errc::link_lost, where + error.message());
}

std::unique_ptr<ByteLink> make_link(asio::io_context& io, const Address& address,
                                    const LinkOptions& options) {
  switch (address.kind) {
    case Kind::serial:
      return make_serial_link(io, address, options);
    case Kind::tcp:
      return make_tcp_link(io, address, options);
    case Kind::tcp_listen:
      return make_listen_link(io, address, options);
    case Kind::udp:
      return make_udp_link(io, address, options);
  }
  return nullptr;
}

}  // namespace anchord::link
