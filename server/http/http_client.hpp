#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord::server {

struct ClientResponse {
  int status{};
  std::map<std::string, std::string> headers;  ///< names lower case
  std::string body;
};

/// A call whose body or answer is too large to hold, or that a stranger may answer.
struct ClientRequest {
  std::string_view method, target;
  std::string_view body{};
  std::string_view content_type{"application/json"};
  std::map<std::string, std::string> headers{};
  std::FILE* from{nullptr};  ///< all of it is the body, or the part below
  std::uint64_t from_at{0};
  std::optional<std::uint64_t> from_bytes{};
  std::FILE* into{nullptr};  ///< becomes the body of a 200
  std::uint64_t into_at{0};  ///< a 206 goes on from here
  /// With the head of an answer whose body would go there, before anything of the file changes.
  std::function<Result<void>(const ClientResponse& head)> accepts{};
  /// With the same head when the file is as long as the answer says, before the body's first byte.
  std::function<Result<void>(const ClientResponse& head)> begins{};
  /// Of the answer, unpacked. With it the answer must also begin within the time-out after the last byte of
  /// the request, and then come with some speed.
  std::optional<std::uint64_t> most_bytes{};
};

/// A blocking HTTP client for our own commands and tests: one connection, kept alive. No redirects, no
/// proxies. One thread at a time.
class HttpClient {
 public:
  /// "http://127.0.0.1:8420" or "https://host/prefix"; targets of call() come after the prefix.
  /// Errors: invalid_argument.
  static Result<HttpClient> to(std::string_view url,
                               std::chrono::milliseconds timeout = std::chrono::seconds(30));
  /// Servers whose certificate is signed by one of this PEM file are trusted, instead of those the system
  /// trusts. Else ANCHORD_CA_FILE says which. Before to().
  static void trust(const std::string& ca_file);
  ~HttpClient();
  HttpClient(HttpClient&& other) noexcept;
  HttpClient& operator=(HttpClient&&) = delete;

  /// Header sent with every call, e.g. "Authorization".
  void set_header(const std::string& name, const std::string& value);
  /// Any status is an answer. Errors: link_lost (no connection, time-out, not HTTP).
  Result<ClientResponse> call(std::string_view method, std::string_view target, std::string_view body = {},
                              std::string_view content_type = "application/json",
                              const std::map<std::string, std::string>& headers = {});
  /// errors: as above (also too slow); bad_frame (longer than it may be), storage_full and
  /// storage_unavailable (of the files)
  Result<ClientResponse> call(const ClientRequest& request);

 private:
  struct State;
  explicit HttpClient(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace anchord::server
