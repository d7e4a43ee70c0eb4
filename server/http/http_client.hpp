#pragma once

#include <chrono>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::server {

struct ClientResponse {
  int status{};
  std::map<std::string, std::string> headers;  ///< names lower case
  std::string body;
};

/// A small blocking HTTP/1.1 client for our own commands (health check, replay, token): one connection, kept
/// alive, reopened once when the server had closed it. Plain http only; no redirects, no proxies. One thread
/// at a time.
class HttpClient {
 public:
  /// "http://127.0.0.1:8420". Errors: invalid_argument.
  static Result<HttpClient> to(std::string_view url,
                               std::chrono::milliseconds timeout = std::chrono::seconds(30));
  ~HttpClient();
  HttpClient(HttpClient&& other) noexcept;
  HttpClient& operator=(HttpClient&&) = delete;

  /// Header sent with every call, e.g. "Authorization".
  void set_header(std::string name, std::string value);
  /// Any status is an answer. Errors: link_lost (no connection, time-out, not HTTP).
  Result<ClientResponse> call(std::string_view method, std::string_view target, std::string_view body = {},
                              std::string_view content_type = "application/json");

 private:
  HttpClient() = default;
  Result<void> connect();
  void close();
  Result<ClientResponse> exchange(const std::string& request);
  Result<void> fill();

  std::string host_, port_;
  std::chrono::milliseconds timeout_{};
  std::vector<std::pair<std::string, std::string>> headers_;
  int fd_{-1};
  std::string input_;
};

}  // namespace anchord::server
