#include "drivers/link/address.hpp"

#include <charconv>

#include "core/base/text.hpp"

namespace anchord::link {
namespace {

Error bad(std::string_view text, std::string_view why) {
  return make_error(Errc::invalid_argument, "\"" + to_utf8(text, 200) + "\": " + std::string(why));
}

template <class T>
bool whole_number(std::string_view text, T& out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc{} && end == text.data() + text.size();
}

bool take_prefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

Result<Address> serial(std::string_view text, std::string_view rest) {
  Address out;
  const auto question = rest.find('?');
  out.path = std::string(rest.substr(0, question));
  if (out.path.empty() || out.path.front() != '/')
    return bad(text, "a serial port must be an absolute path, like /dev/ttyUSB0");
  if (question == std::string_view::npos) return out;
  auto query = rest.substr(question + 1);
  if (!take_prefix(query, "baud=")) return bad(text, "the only option of a serial port is ?baud=");
  if (!whole_number(query, out.baud) || out.baud < 1200 || out.baud > 4'000'000) {
    return bad(text, "baud must be a number from 1200 to 4000000");
  }
  return out;
}

Result<Address> socket(std::string_view text, std::string_view rest, Kind kind) {
  Address out;
  out.kind = kind;
  const auto colon = rest.rfind(':');
  if (colon == std::string_view::npos) return bad(text, "the port is missing (host:port)");
  auto host = rest.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return bad(text, "write an IPv6 address in brackets");
  }
  if (host.find_first_of("/?#@ ") != std::string_view::npos) return bad(text, "this is not a host name");
  out.host = std::string(host);
  if (!whole_number(rest.substr(colon + 1), out.port))
    return bad(text, "the port must be a number from 0 to 65535");
  const bool connects =
      kind == Kind::tcp || (kind == Kind::udp && !host.empty() && host != "0.0.0.0" && host != "::");
  if (connects && out.port == 0) return bad(text, "port 0 cannot be used to connect");
  if (kind == Kind::tcp && host.empty()) return bad(text, "the host is missing");
  return out;
}

}  // namespace

Result<Address> parse_address(std::string_view text) {
  if (text.size() > 500) return bad(text, "longer than 500 characters");
  auto rest = text;
  if (take_prefix(rest, "serial:")) return serial(text, rest);
  if (take_prefix(rest, "tcp://")) return socket(text, rest, Kind::tcp);
  if (take_prefix(rest, "tcp-listen://")) return socket(text, rest, Kind::tcp_listen);
  if (take_prefix(rest, "udp://")) return socket(text, rest, Kind::udp);
  return bad(text, "must begin with serial:, tcp://, tcp-listen:// or udp://");
}

bool others_may_reach(const Address& address) {
  if (address.kind == Kind::serial || address.host.empty()) return false;
  const bool loopback =
      address.host == "localhost" || address.host == "::1" || address.host.rfind("127.", 0) == 0;
  return !loopback;
}

std::string to_string(const Address& address) {
  if (address.kind == Kind::serial) {
    return "serial:" + address.path + (address.baud == 115200 ? "" : "?baud=" + std::to_string(address.baud));
  }
  const bool v6 = address.host.find(':') != std::string::npos;
  const std::string scheme = address.kind == Kind::tcp          ? "tcp://"
                             : address.kind == Kind::tcp_listen ? "tcp-listen://"
                                                                : "udp://";
  return scheme + (v6 ? "[" + address.host + "]" : address.host) + ":" + std::to_string(address.port);
}

}  // namespace anchord::link
