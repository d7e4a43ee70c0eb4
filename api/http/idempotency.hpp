#pragma once

#include <functional>
#include <mutex>
#include <set>
#include <string>

#include "api/http/message.hpp"

namespace anchord {
class AccessStore;
class Clock;
}  // namespace anchord

namespace anchord::api {

/// Lower-case hex SHA-256.
std::string sha256_hex(std::string_view bytes);

/// Idempotency-Key of POST: the answer is kept 24 h by (principal, key). The same key with another request is
/// 422, a request still running 409. Answers of 5xx are not kept, so that a retry may succeed. Thread-safe.
class Idempotency {
 public:
  Idempotency(AccessStore& answers, const Clock& clock) : answers_(answers), clock_(clock) {}
  Response run(Request& request, const std::function<Response(Request&)>& handler);

 private:
  AccessStore& answers_;
  const Clock& clock_;
  std::mutex mutex_;
  std::set<std::string> running_;
};

}  // namespace anchord::api
