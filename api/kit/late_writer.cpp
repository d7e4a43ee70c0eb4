#include "api/kit/late_writer.hpp"

#include <utility>

#include "core/base/retry.hpp"

namespace anchord::api {
namespace {

constexpr auto k_pause = std::chrono::milliseconds(500);

}  // namespace

struct LateWriter::Entry {
  Write write;
  bool done{false};
};

LateWriter::LateWriter(std::function<void(std::string_view)> log)
    : log_(std::move(log)), thread_("anchord-late", [this] { run(); }) {}
LateWriter::~LateWriter() { stop(); }

bool LateWriter::write(Write write, std::chrono::milliseconds patience) {
  const auto entry = std::make_shared<Entry>(Entry{std::move(write), false});
  bool lost = false;
  std::unique_lock lock(mutex_);
  if (stopping_) {
    lock.unlock();
    return attempt(entry->write).has_value();  // nobody would come for it
  }
  if (entries_.size() >= k_max_waiting) {
    entries_.pop_front();
    lost = true;
  }
  entries_.push_back(entry);
  work_.notify_one();
  const bool done = written_.wait_for(lock, patience, [&] { return entry->done; });
  lock.unlock();
  if (lost) report("a line of the audit log was lost: the database accepted no write for too long");
  return done;
}

void LateWriter::idle_task(std::function<void()> task) {
  {
    const std::scoped_lock lock(mutex_);
    if (stopping_ || task_) return;
    task_ = std::move(task);
  }
  work_.notify_one();
}

bool LateWriter::flush(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  return written_.wait_for(lock, patience, [&] { return entries_.empty(); });
}

std::size_t LateWriter::waiting() const {
  const std::scoped_lock lock(mutex_);
  return entries_.size();
}

void LateWriter::stop() {
  {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
  }
  work_.notify_all();
  if (thread_.joinable()) thread_.join();
}

/// The thread outlives whatever a write throws.
Result<void> LateWriter::attempt(const Write& write) {
  Result<void> done = boost::outcome_v2::success();
  const auto ran = guarded("late write", [&] { done = write(); });
  return ran ? done : make_error(Errc::internal, ran.what);
}

void LateWriter::run() {
  std::unique_lock lock(mutex_);
  bool troubled = false;
  for (;;) {
    if (troubled && !stopping_) work_.wait_for(lock, k_pause, [&] { return stopping_; });
    work_.wait(lock, [&] { return stopping_ || !entries_.empty() || task_; });
    if (entries_.empty()) {
      if (stopping_) return;
      const auto task = std::exchange(task_, nullptr);
      lock.unlock();
      (void)guarded("late task", task);
      lock.lock();
      continue;
    }
    const auto entry = entries_.front();
    const bool last_try = stopping_;
    lock.unlock();
    const auto written = attempt(entry->write);
    const bool again = !written && may_pass(written.error().code) && !last_try;
    if (!written && !troubled) report("a write that follows its answer failed: " + written.error().message);
    lock.lock();
    troubled = again;
    if (again) continue;
    entry->done = true;
    // Unless it was the oldest that had to go meanwhile.
    if (!entries_.empty() && entries_.front() == entry) entries_.pop_front();
    written_.notify_all();
  }
}

Result<std::optional<StoredAnswer>> PromptAccessStore::answer(std::string_view principal,
                                                              std::string_view key) {
  {
    const std::scoped_lock lock(mutex_);
    const auto at = pending_.find({std::string(principal), std::string(key)});
    if (at != pending_.end()) return std::optional(at->second);
  }
  return inner_.answer(principal, key);
}

Result<void> PromptAccessStore::keep_answer(const StoredAnswer& answer, std::int64_t expired_ran_ns) {
  const std::pair name(answer.principal, answer.key);
  {
    const std::scoped_lock lock(mutex_);
    if (pending_.size() >= LateWriter::k_max_waiting) pending_.erase(pending_.begin());
    pending_[name] = answer;
  }
  writer_.write([this, answer, name, expired_ran_ns]() -> Result<void> {
    auto kept = inner_.keep_answer(answer, expired_ran_ns);
    const std::scoped_lock lock(mutex_);
    if (kept || !may_pass(kept.error().code)) pending_.erase(name);
    return kept;
  });
  return boost::outcome_v2::success();
}

Result<std::size_t> PromptAccessStore::drop_oldest_answers(std::string_view principal, std::size_t most) {
  writer_.write([this, who = std::string(principal), most]() -> Result<void> {
    BOOST_OUTCOME_TRYV(inner_.drop_oldest_answers(who, most));
    return boost::outcome_v2::success();
  });
  return most;
}

Result<void> PromptAccessStore::append_audit(const AuditEntry& entry) {
  writer_.write([this, entry] { return inner_.append_audit(entry); });
  return boost::outcome_v2::success();
}

Result<std::vector<AuditEntry>> PromptAccessStore::audit(std::size_t limit) {
  writer_.flush(std::chrono::seconds(1));
  return inner_.audit(limit);
}

}  // namespace anchord::api
