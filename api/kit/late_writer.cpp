#include "api/kit/late_writer.hpp"

#include <utility>

#include "core/base/retry.hpp"

namespace anchord::api {
namespace {

constexpr auto k_pause = std::chrono::milliseconds(500);

}  // namespace

struct LateWriter::Entry {
  Write write;
  bool done{false};  ///< under the lock of waiting_
};

LateWriter::LateWriter(std::function<void(std::string_view)> log)
    : log_(std::move(log)), thread_("anchord-late", [this] { run(); }) {}
LateWriter::~LateWriter() { stop(); }

bool LateWriter::write(Write write, std::chrono::milliseconds patience) {
  const auto entry = std::make_shared<Entry>(Entry{std::move(write), false});
  bool queued = false, done = false;
  std::shared_ptr<Entry> lost;
  {
    auto waiting = waiting_.lock();
    if (!waiting->stopping) {
      queued = true;
      if (waiting->entries.size() >= k_max_waiting) {
        lost = std::move(waiting->entries.front());
        waiting->entries.pop_front();
      }
      waiting->entries.push_back(entry);
      work_.notify_one();
      done = waiting.wait_for(written_, patience, [&](const Waiting&) { return entry->done; });
    }
  }
  if (!queued) return attempt(entry->write).has_value();  // nobody would come for it
  if (lost) report("an entry of the audit log was lost: the database did not accept a write for too long");
  return done;
}

void LateWriter::idle_task(std::function<void()> task) {
  {
    auto waiting = waiting_.lock();
    if (waiting->stopping || waiting->task) return;
    waiting->task = std::move(task);
  }
  work_.notify_one();
}

bool LateWriter::flush(std::chrono::milliseconds patience) {
  auto waiting = waiting_.lock();
  return waiting.wait_for(written_, patience, [](const Waiting& w) { return w.entries.empty(); });
}

std::size_t LateWriter::waiting() const {
  const auto waiting = waiting_.lock();
  return waiting->entries.size();
}

void LateWriter::stop() {
  {
    auto waiting = waiting_.lock();
    waiting->stopping = true;
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
  bool troubled = false;
  for (;;) {
    std::shared_ptr<Entry> entry;
    std::function<void()> task;
    bool last_try = false;
    {
      auto waiting = waiting_.lock();
      if (troubled) waiting.wait_for(work_, k_pause, [](const Waiting& w) { return w.stopping; });
      waiting.wait(work_, [](const Waiting& w) { return w.stopping || !w.entries.empty() || w.task; });
      last_try = waiting->stopping;
      if (!waiting->entries.empty())
        entry = waiting->entries.front();
      else if (last_try)
        return;
      else
        task = std::exchange(waiting->task, nullptr);
    }
    if (!entry) {
      (void)guarded("late task", task);
      continue;
    }
    const auto written = attempt(entry->write);
    const bool again = !written && may_pass(written.error().code) && !last_try;
    if (!written && !troubled) report("a write after the answer failed: " + written.error().message);
    troubled = again;
    if (again) continue;
    auto waiting = waiting_.lock();
    entry->done = true;
    // Unless it was the oldest that had to go meanwhile.
    if (!waiting->entries.empty() && waiting->entries.front() == entry) waiting->entries.pop_front();
    written_.notify_all();
  }
}

Result<std::optional<StoredAnswer>> PromptAccessStore::answer(std::string_view principal,
                                                              std::string_view key) {
  {
    const auto pending = pending_.lock();
    const auto at = pending->find({std::string(principal), std::string(key)});
    if (at != pending->end()) return std::optional(at->second);
  }
  return inner_.answer(principal, key);
}

Result<void> PromptAccessStore::keep_answer(const StoredAnswer& answer, std::int64_t expired_ran_ns) {
  const std::pair name(answer.principal, answer.key);
  {
    auto pending = pending_.lock();
    if (pending->size() >= LateWriter::k_max_waiting) pending->erase(pending->begin());
    pending->insert_or_assign(name, answer);
  }
  writer_.write([this, answer, name, expired_ran_ns]() -> Result<void> {
    auto kept = inner_.keep_answer(answer, expired_ran_ns);
    auto pending = pending_.lock();
    if (kept || !may_pass(kept.error().code)) pending->erase(name);
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
