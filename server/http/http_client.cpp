#include "server/http/http_client.hpp"

#include <netdb.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>

#include "server/http/text.hpp"

namespace anchord::server {
namespace {

std::optional<std::size_t> number(std::string_view text, int base) {
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end == text.data()) return std::nullopt;
  return value;
}

Error lost(std::string_view what) { return make_error(Errc::link_lost, std::string(what)); }

}  // namespace

Result<HttpClient> HttpClient::to(std::string_view url, std::chrono::milliseconds timeout) {
  const auto bad = [&] {
    return make_error(Errc::invalid_argument,
                      "'" + std::string(url.substr(0, 80)) + "' is not like http://127.0.0.1:8420");
  };
  if (!url.starts_with("http://")) return bad();
  url.remove_prefix(7);
  while (url.ends_with('/')) url.remove_suffix(1);
  const auto colon = url.rfind(':');
  const bool has_port = colon != std::string_view::npos && url.find(']', colon) == std::string_view::npos;
  std::string_view host = has_port ? url.substr(0, colon) : url;
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  if (host.empty() || url.find('/') != std::string_view::npos) return bad();
  HttpClient client;
  client.host_ = std::string(host);
  client.port_ = has_port ? std::string(url.substr(colon + 1)) : "80";
  client.timeout_ = timeout;
  return client;
}

HttpClient::HttpClient(HttpClient&& other) noexcept
    : host_(std::move(other.host_)),
      port_(std::move(other.port_)),
      timeout_(other.timeout_),
      headers_(std::move(other.headers_)),
      fd_(std::exchange(other.fd_, -1)),
      input_(std::move(other.input_)) {}

HttpClient::~HttpClient() { close(); }

void HttpClient::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  input_.clear();
}

void HttpClient::set_header(std::string name, std::string value) {
  headers_.emplace_back(std::move(name), std::move(value));
}

Result<void> HttpClient::connect() {
  close();
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host_.c_str(), port_.c_str(), &hints, &found) != 0) return lost(host_ + " has no address");
  std::string why = "no address";
  for (const addrinfo* at = found; at != nullptr && fd_ < 0; at = at->ai_next) {
    const int fd = ::socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC, at->ai_protocol);
    if (fd < 0) continue;
    const auto us = std::chrono::duration_cast<std::chrono::microseconds>(timeout_).count();
    const timeval limit{us / 1'000'000, us % 1'000'000};
    const int one = 1;
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    if (::connect(fd, at->ai_addr, at->ai_addrlen) == 0) {
      fd_ = fd;
    } else {
      why = std::strerror(errno);
      ::close(fd);
    }
  }
  freeaddrinfo(found);
  if (fd_ < 0) return lost("cannot reach " + host_ + ":" + port_ + ": " + why);
  return boost::outcome_v2::success();
}

Result<void> HttpClient::fill() {
  std::array<char, 16 * 1024> piece;
  const ssize_t n = ::recv(fd_, piece.data(), piece.size(), 0);
  if (n <= 0) return lost(n == 0 ? "the server closed the connection" : std::strerror(errno));
  input_.append(piece.data(), static_cast<std::size_t>(n));
  return boost::outcome_v2::success();
}

Result<ClientResponse> HttpClient::exchange(const std::string& request) {
  for (std::size_t sent = 0; sent < request.size();) {
    const ssize_t n = ::send(fd_, request.data() + sent, request.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) break;  // an early answer may be waiting: read it
    sent += static_cast<std::size_t>(n);
  }
  std::size_t end = 0;
  while ((end = input_.find("\r\n\r\n")) == std::string::npos) {
    BOOST_OUTCOME_TRYV(fill());
  }
  ClientResponse response;
  const std::string head = input_.substr(0, end);
  input_.erase(0, end + 4);
  const auto lines = split(head, '\n');
  if (!lines[0].starts_with("HTTP/1.1 ") || lines[0].size() < 12) return lost("the answer is not HTTP");
  response.status = static_cast<int>(number(lines[0].substr(9, 3), 10).value_or(0));
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const auto colon = lines[i].find(':');
    if (colon == std::string_view::npos) continue;
    auto value = lines[i].substr(colon + 1);
    if (value.ends_with('\r')) value.remove_suffix(1);
    response.headers[lower(lines[i].substr(0, colon))] = std::string(trim(value));
  }
  const auto take = [&](std::size_t n) -> Result<std::string> {
    while (input_.size() < n) {
      BOOST_OUTCOME_TRYV(fill());
    }
    std::string bytes = input_.substr(0, n);
    input_.erase(0, n);
    return bytes;
  };
  if (response.headers.contains("transfer-encoding")) {
    for (;;) {
      std::size_t line = 0;
      while ((line = input_.find("\r\n")) == std::string::npos) {
        BOOST_OUTCOME_TRYV(fill());
      }
      const auto size = number(std::string_view(input_).substr(0, line), 16);
      if (!size) return lost("broken chunk in the answer");
      input_.erase(0, line + 2);
      BOOST_OUTCOME_TRY(const auto chunk, take(*size + 2));
      if (*size == 0) break;
      response.body.append(chunk, 0, *size);
    }
  } else if (const auto length = response.headers.find("content-length"); length != response.headers.end()) {
    BOOST_OUTCOME_TRY(response.body, take(number(length->second, 10).value_or(0)));
  }
  if (response.headers["connection"] == "close") close();
  return response;
}

Result<ClientResponse> HttpClient::call(std::string_view method, std::string_view target,
                                        std::string_view body, std::string_view content_type) {
  std::string request;
  request.append(method).append(" ").append(target).append(" HTTP/1.1\r\nHost: ");
  request.append(host_.find(':') == std::string::npos ? host_ : "[" + host_ + "]").append(":").append(port_);
  for (const auto& [name, value] : headers_) request.append("\r\n").append(name).append(": ").append(value);
  if (!body.empty()) request.append("\r\nContent-Type: ").append(content_type);
  if (!body.empty() || method == "POST" || method == "PUT" || method == "PATCH") {
    request.append("\r\nContent-Length: ").append(std::to_string(body.size()));
  }
  request.append("\r\n\r\n").append(body);
  const bool reused = fd_ >= 0;
  if (!reused) {
    BOOST_OUTCOME_TRYV(connect());
  }
  auto answer = exchange(request);
  if (!answer && reused) {
    // A kept connection may have been closed while it was idle; a fresh one decides.
    BOOST_OUTCOME_TRYV(connect());
    answer = exchange(request);
  }
  if (!answer) close();
  return answer;
}

}  // namespace anchord::server
