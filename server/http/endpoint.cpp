#include "server/http/endpoint.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <charconv>

#include "core/base/text.hpp"

namespace anchord::server {
namespace {

bool out_of_descriptors(const error_code& error) {
  return error == asio::error::no_descriptors || error.value() == ENFILE ||
         error == asio::error::no_buffer_space || error == asio::error::no_memory;
}

}  // namespace

Result<tcp::endpoint> parse_endpoint(std::string_view text) {
  const auto bad = [&] {
    return make_error(Errc::invalid_argument,
                      "'" + to_utf8(text, 80) + "' is not an address like 127.0.0.1:8420 or [::1]:8420");
  };
  const auto colon = text.rfind(':');
  if (colon == std::string_view::npos) return bad();
  std::string_view host = text.substr(0, colon);
  const std::string_view digits = text.substr(colon + 1);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  if (host == "localhost") host = "127.0.0.1";
  std::uint16_t port = 0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (digits.empty() || status != std::errc{} || end != digits.data() + digits.size()) return bad();
  error_code error;
  const auto address = asio::ip::make_address(std::string(host), error);
  if (error) return bad();
  return tcp::endpoint(address, port);
}

Result<std::shared_ptr<tcp::acceptor>> listen_at(asio::io_context& io, std::string_view text) {
  BOOST_OUTCOME_TRY(const auto endpoint, parse_endpoint(text));
  auto acceptor = std::make_shared<tcp::acceptor>(io);
  error_code error;
  acceptor->open(endpoint.protocol(), error);
  if (!error) acceptor->set_option(tcp::acceptor::reuse_address(true), error);
  if (!error && endpoint.address().is_v6()) acceptor->set_option(asio::ip::v6_only(true), error);
  if (!error) acceptor->bind(endpoint, error);
  if (!error) acceptor->listen(1024, error);
  if (error) {
    const auto code = error == asio::error::address_in_use ? Errc::conflict : Errc::unsupported;
    return make_error(code, "cannot listen on " + std::string(text) + ": " + error.message());
  }
  return acceptor;
}

asio::awaitable<bool> accept_one(tcp::acceptor& acceptor, tcp::socket& socket) {
  const auto [error] = co_await acceptor.async_accept(socket, k_wait);
  if (!error) co_return true;
  if (error != asio::error::operation_aborted && acceptor.is_open()) {
    asio::steady_timer pause(acceptor.get_executor(),
                             std::chrono::milliseconds(out_of_descriptors(error) ? 200 : 10));
    co_await pause.async_wait(k_wait);
  }
  co_return false;
}

std::string unread_503(std::string_view why) {
  const std::string body =
      R"({"type":"/problems/overloaded","title":"The server is overloaded","status":503,"detail":")" +
      std::string(why) + R"(; try again"})";
  return "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nContent-Type: application/problem+json\r\n"
         "Content-Length: " +
         std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + body;
}

}  // namespace anchord::server
