#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/result.hpp"

namespace anchord::cli {

/// Requests to a running anchord. Sends again with growing pauses while the server is away, busy or full of
/// work; gives up after a minute, and after 2 s when nothing ever answered there. Everything it sends may
/// arrive twice, which is why rows have identities and creations an Idempotency-Key. One thread.
class RestClient {
 public:
  /// `url`: http://host:port, with or without a path before /api. `cancelled` ends waiting early.
  /// errors  invalid_argument when it is no such URL
  static Result<std::unique_ptr<RestClient>> make(const std::string& url, const std::string& token,
                                                  std::function<bool()> cancelled);
  ~RestClient();

  /// Body of the 2xx. errors: link_lost (gave up), canceled, invalid_argument and others (the server's 4xx,
  /// with its words).
  Result<std::string> get(const std::string& path);
  Result<std::string> post(const std::string& path, const std::string& content_type, const std::string& body,
                           const std::string& idempotency_key = {});

 private:
  struct State;
  explicit RestClient(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// First line of a file with an access token, without white space; for an empty path what ANCHORD_TOKEN says.
Result<std::string> read_token_file(const std::string& path);

}  // namespace anchord::cli
