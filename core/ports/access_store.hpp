#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord {

/// Answers kept for Idempotency-Key, and the append-only audit log with its hash chain.
struct StoredAnswer {
  std::string key, principal, request_sha256_hex, body;
  std::string location, etag;  ///< its headers of these names; empty: it had none
  int status{};
  std::int64_t created_ran_ns{};  ///< running time of the service (ServiceStore): no clock step ends it early
};
/// What the kept answers of one principal take.
struct AnswerUse {
  std::size_t count{};
  std::uint64_t bytes{};  ///< of bodies
};
struct AuditEntry {
  UtcTime time{};
  std::string who, what, from, result;
};

class AccessStore {
 public:
  virtual ~AccessStore() = default;
  virtual Result<std::optional<StoredAnswer>> answer(std::string_view principal, std::string_view key) = 0;
  /// Takes the place of one that was kept before `expired_ran_ns`; conflict when the principal has a younger
  /// one under this key.
  virtual Result<void> keep_answer(const StoredAnswer& answer, std::int64_t expired_ran_ns) = 0;
  virtual Result<AnswerUse> answer_use(std::string_view principal) = 0;
  /// The oldest first, at most so many in one short transaction; says how many went.
  virtual Result<std::size_t> drop_answers_before(std::int64_t ran_ns, std::size_t most) = 0;
  virtual Result<std::size_t> drop_oldest_answers(std::string_view principal, std::size_t most) = 0;
  virtual Result<void> append_audit(const AuditEntry& entry) = 0;
  virtual Result<std::vector<AuditEntry>> audit(std::size_t limit) = 0;  ///< newest first
  /// conflict, naming the entry, when the hash chain is broken.
  virtual Result<void> verify_audit() = 0;
};

}  // namespace anchord
