#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/ports/access_store.hpp"

namespace anchord::api {

/// Writes that their sender waits for only a moment: a command to an aircraft is answered although the disk
/// is slow, and its line in the audit log follows. One thread, in order. A write that fails because the store
/// is in trouble is tried again until it succeeds; at most 4096 wait, then the oldest is lost, which is
/// logged. Thread-safe.
class LateWriter {
 public:
  using Write = std::function<Result<void>()>;
  static constexpr std::size_t k_max_waiting = 4096;
  static constexpr std::chrono::milliseconds k_patience{50};

  explicit LateWriter(std::function<void(std::string_view what)> log);
  /// stop().
  ~LateWriter();
  LateWriter(const LateWriter&) = delete;
  LateWriter& operator=(const LateWriter&) = delete;

  /// Waits until it is written, at most so long. True: it is; false: it will be.
  bool write(Write write, std::chrono::milliseconds patience = k_patience);
  /// Work that nobody waits for, when no write does. A second one while the first has not begun is dropped.
  void idle_task(std::function<void()> task);
  /// Until everything that was given so far is written, at most so long.
  bool flush(std::chrono::milliseconds patience);
  /// Tries what waits once more, then ends. Idempotent.
  void stop();
  std::size_t waiting() const;

 private:
  struct Entry;
  void run();
  static Result<void> attempt(const Write& write);
  void report(std::string_view what) const {
    if (log_) log_(what);
  }

  struct Waiting {
    std::deque<std::shared_ptr<Entry>> entries;
    std::function<void()> task;
    bool stopping{false};
  };

  const std::function<void(std::string_view)> log_;
  Locked<Waiting> waiting_;
  std::condition_variable work_, written_;
  Thread thread_;
};

/// An AccessStore that answers its writers at once (LateWriter) and remembers what is not on the disk yet.
class PromptAccessStore final : public AccessStore {
 public:
  /// Both must outlive it; the writer ends first.
  PromptAccessStore(AccessStore& inner, LateWriter& writer) : inner_(inner), writer_(writer) {}

  Result<std::optional<StoredAnswer>> answer(std::string_view principal, std::string_view key) override;
  Result<void> keep_answer(const StoredAnswer& answer, std::int64_t expired_ran_ns) override;
  Result<AnswerUse> answer_use(std::string_view principal) override { return inner_.answer_use(principal); }
  Result<std::size_t> drop_answers_before(std::int64_t ran_ns, std::size_t most) override {
    return inner_.drop_answers_before(ran_ns, most);
  }
  Result<std::size_t> drop_oldest_answers(std::string_view principal, std::size_t most) override;
  Result<void> append_audit(const AuditEntry& entry) override;
  /// With what is still to be written, if that takes no longer than a second.
  Result<std::vector<AuditEntry>> audit(std::size_t limit) override;
  Result<void> verify_audit() override { return inner_.verify_audit(); }

 private:
  AccessStore& inner_;
  LateWriter& writer_;
  /// By principal and key.
  Locked<std::map<std::pair<std::string, std::string>, StoredAnswer>> pending_;
};

}  // namespace anchord::api
