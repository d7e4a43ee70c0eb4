#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "core/base/result.hpp"

namespace anchord {

/// Sends bodies to addresses that a client of ours named, and nowhere it could not reach itself: no loopback,
/// private or link-local address unless the operator allows it, the address that was checked is the one that
/// is connected to, no redirects, no proxy. Blocks; thread-safe.
class WebPost {
 public:
  struct Message {
    std::string url;
    std::vector<std::pair<std::string, std::string>> headers;
    std::string body;
    std::string method{"POST"};
  };
  struct Answer {
    int status{};
    std::string body;  ///< at most k_most_answer of it; more is not read
  };
  static constexpr std::size_t k_most_answer = 1u << 20;
  virtual ~WebPost() = default;
  /// Whether the form of the URL is one that post() takes; its name is not resolved. Errors:
  /// invalid_argument.
  virtual Result<void> check(const std::string& url) const = 0;
  /// The answer, whatever its status is. Within 20 s. Errors: invalid_argument (an address that is not
  /// allowed), link_lost (no answer), canceled (stop).
  virtual Result<Answer> send(const Message& message) = 0;
  /// The same, for whom the status is all.
  Result<int> post(const Message& message) {
    BOOST_OUTCOME_TRY(const auto answer, send(message));
    return answer.status;
  }
  /// Ends the posts that run, and every later one at once.
  virtual void stop() = 0;
};

}  // namespace anchord
