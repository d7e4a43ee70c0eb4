#pragma once

#include <coroutine>
#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>

#include "drivers/pozyx/protocol.hpp"
#include "drivers/pozyx/script.hpp"

namespace anchord::pozyx {

inline constexpr std::int64_t k_ms = 1'000'000;  ///< in ns

struct ConversationOptions {
  std::int64_t settle_ns = 250'000'000;    ///< after opening, before the first question
  std::int64_t patience_ns = 200'000'000;  ///< for an answer; the maker's client has 100 ms
  std::int64_t quiet_ns = 50'000'000;      ///< of silence, before an answer can be believed again
  std::int64_t drain_ns = 2'000'000'000;   ///< at most waited for silence
};

/// What went wrong on the wire.
struct ConversationCounters {
  std::uint64_t timeouts{}, bad_replies{}, stray_lines{}, resyncs{};
};

/// Question and answer with a tag over a wire on which nothing proves itself. After any answer that is late
/// or malformed every later one would belong to the question before it; so the input is drained until it is
/// silent, and WHO_AM_I asked until its answer comes, before the next question. Driven by bytes and time
/// (steady nanoseconds, not falling). Not thread-safe.
class Conversation {
 public:
  using Send = std::function<void(std::string_view)>;
  explicit Conversation(Send send, const ConversationOptions& options = {})
      : send_(std::move(send)), options_(options) {}
  Conversation(const Conversation&) = delete;
  Conversation& operator=(const Conversation&) = delete;

  void bytes(std::string_view bytes, std::int64_t now_ns);
  void tick(std::int64_t now_ns);
  void set_now(std::int64_t now_ns) { now_ns_ = now_ns; }
  std::int64_t now_ns() const { return now_ns_; }
  std::optional<std::int64_t> deadline_ns() const;
  /// Ends a pause() early: something else is to be done.
  void wake();

  // For scripts. errors: link_lost (no answer in time), bad_frame (another answer), conflict (refused by the
  // tag; the wire is fine)
  Script<Result<Bytes>> read(std::uint8_t address, std::size_t n);
  /// Answered by nothing.
  void write(std::uint8_t address, ByteView data);
  /// Result without the status byte.
  Script<Result<Bytes>> call(std::uint8_t function, Bytes parameters, std::size_t result_bytes);
  /// Settles, drains and proves that answers belong to questions.
  Script<Result<void>> open();
  Script<Result<void>> resync();

  struct Wait {
    Conversation& c;
    enum class Kind : std::uint8_t { none, line, silence, pause } kind;
    std::int64_t until_ns;
    bool await_ready() const { return kind == Kind::line && c.next_line(); }
    void await_suspend(std::coroutine_handle<> script) { c.wait(script, *this); }
    /// Of line: whether one came (see line()).
    bool await_resume() const { return c.line_.has_value(); }
  };
  Wait pause(std::int64_t ns) { return {*this, Wait::Kind::pause, now_ns_ + ns}; }

  const ConversationCounters& counters() const { return counters_; }

 private:
  friend struct Wait;
  Script<Result<Bytes>> ask(std::string question, std::size_t answer_bytes);
  Script<Error> lost_track(Error why);
  bool next_line();
  void wait(std::coroutine_handle<> script, const Wait& wait);
  void resume();

  Send send_;
  ConversationOptions options_;
  ConversationCounters counters_{};
  Lines lines_;
  std::optional<std::string> line_{};
  std::coroutine_handle<> waiting_{};
  Wait::Kind kind_{Wait::Kind::none};
  std::int64_t until_ns_{0}, silent_since_ns_{0}, now_ns_{0}, quiet_ns_{0};
  bool proven_{false};  ///< that the next answer belongs to the next question
};

}  // namespace anchord::pozyx
