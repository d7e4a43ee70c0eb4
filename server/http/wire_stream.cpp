#include "server/http/wire_stream.hpp"

#include <boost/asio/bind_executor.hpp>

namespace anchord::server {

// The executor is bound outside: the handler's own erased one cannot be asked for what tcp_stream asks of it.
// Both are the strand of the socket.
void WireStream::read_some(const Few<asio::mutable_buffer>& into, Done done) {
  auto bound = asio::bind_executor(get_executor(), std::move(done));
  if (tls_) return tls_->async_read_some(into, std::move(bound));
  plain_.async_read_some(into, std::move(bound));
}

void WireStream::write_some(const Few<asio::const_buffer>& from, Done done) {
  auto bound = asio::bind_executor(get_executor(), std::move(done));
  if (tls_) return tls_->async_write_some(from, std::move(bound));
  plain_.async_write_some(from, std::move(bound));
}

}  // namespace anchord::server
