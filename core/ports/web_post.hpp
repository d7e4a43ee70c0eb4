#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/base/result.hpp"

namespace anchord {

/// Sends bodies to addresses that a client of ours named, and nowhere it could not reach itself: no loopback,
/// private or link-local address unless the operator allows it, the address that was checked is the one that
/// is connected to, no redirects, no proxy. Blocks; one thread at a time, stop() from any.
class WebPost {
 public:
  struct Message {
    std::string url;
    std::vector<std::pair<std::string, std::string>> headers;
    std::string body;
  };
  virtual ~WebPost() = default;
  /// Whether the form of the URL is one that post() takes; its name is not resolved. Errors:
  /// invalid_argument.
  virtual Result<void> check(const std::string& url) const = 0;
  /// The status of the answer, whatever it is; its body is thrown away. Within 20 s. Errors: invalid_argument
  /// (an address that is not allowed), link_lost (no answer), canceled (stop).
  virtual Result<int> post(const Message& message) = 0;
  /// Ends the post that runs, and every later one at once.
  virtual void stop() = 0;
};

}  // namespace anchord
