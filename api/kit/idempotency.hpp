#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>

#include "api/kit/message.hpp"
#include "core/base/locked.hpp"
#include "core/ports/access_store.hpp"

namespace anchord::api {

/// Lower-case hex SHA-256.
std::string sha256_hex(std::string_view bytes);

/// What is done for an Idempotency-Key at a route.
enum class Keeps : std::uint8_t {
  nothing,  ///< reads, computations, answers with a secret: the header is ignored
  answer,   ///< kept; beyond the token's quota the request is refused with 429 before it does anything
  always,   ///< kept; beyond the quota the token's oldest go: a command or a measurement is never refused
};

/// Idempotency-Key of POST: the answer is kept by (principal, key) for 24 h of running time. The same key
/// with another request is 422, a request still running 409. Only answers of 2xx and 3xx are kept: what was
/// refused changed nothing and may be tried again. Thread-safe.
class Idempotency {
 public:
  static constexpr std::int64_t k_keep_ns = 24LL * 3600 * 1'000'000'000;
  static constexpr std::size_t k_max_answers = 2000;        ///< of one token
  static constexpr std::uint64_t k_max_bytes = 8ULL << 20;  ///< of one token, bodies
  static constexpr std::size_t k_max_answer_bytes =
      64U << 10;  ///< a larger body is not kept, only that it was done

  /// running_ns: running time of the service (RunningTime).
  Idempotency(AccessStore& answers, std::function<std::int64_t()> running_ns)
      : answers_(answers), running_ns_(std::move(running_ns)) {}
  Response run(Request& request, Keeps keeps, const std::function<Response(Request&)>& handler);
  /// What was counted is counted anew: somebody else dropped some.
  void forget_use();
  /// Drops what has expired, a slice at a time; says whether there may be more.
  bool purge();

 private:
  struct Room {
    bool refused{false};
    std::string why;
  };
  AnswerUse use_of(const std::string& who);
  Room make_room(const std::string& who, Keeps keeps);
  void keep(const Request& request, const Response& response, std::string hash);

  AccessStore& answers_;
  const std::function<std::int64_t()> running_ns_;
  Locked<std::set<std::string>> running_;
  Locked<std::map<std::string, AnswerUse>> use_;  ///< of principals seen since the last purge
};

}  // namespace anchord::api
