#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"

/// Work of jobs that any process may do which has the database (docs/adr/0013). Every time is of the
/// database's clock, never of a caller's. Thread-safe.
namespace anchord {

/// Three begun attempts without an end are enough to say that there will be none.
inline constexpr int k_work_attempts = 3;
/// A longer result is not even read.
inline constexpr std::int64_t k_most_result_bytes = std::int64_t{512} << 20;

struct NewWork {
  JobId job{};
  std::string kind, version;  ///< of anchord: who has another one does not claim it
  std::string message;
  int max_attempts{k_work_attempts};
};

struct WorkClaim {
  JobId job{};
  std::string kind, message;
  std::int64_t fence{};  ///< another claim of the same work has a greater one
  int attempt{1};
};

enum class WorkState : std::uint8_t { open, claimed, done };
inline constexpr auto k_work_state_words = enum_table<WorkState>(
    {{"open", WorkState::open}, {"claimed", WorkState::claimed}, {"done", WorkState::done}});

/// All about a work but its message and its result.
struct WorkStatus {
  JobId job{};
  std::string kind, version;
  WorkState state{WorkState::open};
  std::int64_t fence{};
  std::string worker;  ///< of the newest claim; empty: none began it
  int attempts{}, max_attempts{};
  double fraction{};
  std::string stage, detail;
  std::string fault;   ///< why the attempt before this one ended; empty: there was none
  double waiting_s{};  ///< since when nobody has it; 0 where somebody does
};

/// What a done work ended with.
struct WorkOutcome {
  std::string result;
  std::optional<Error> error;  ///< set: there is no result
};

struct WorkerStatus {
  std::string name, version;
  double seen_s_ago{};
  std::optional<JobId> job{};  ///< what it works on
};

class WorkStore {
 public:
  virtual ~WorkStore() = default;

  // Of who has work to give.

  /// In place of an older one of the same job.
  virtual Result<void> offer(const NewWork& work) = 0;
  /// Ends claims whose time is over where nobody may try again: no attempt is left, or it was to be canceled.
  virtual Result<void> end_hopeless() = 0;
  virtual Result<std::vector<WorkStatus>> all() = 0;
  /// conflict: it is not done
  virtual Result<WorkOutcome> outcome(const JobId& job) = 0;
  /// Of this offer alone, or whatever there is of the job.
  virtual Result<void> remove(const JobId& job, std::optional<std::int64_t> fence = {}) = 0;
  /// False: there is no such work. One that waits ends at once, one that runs when its worker hears of it.
  virtual Result<bool> cancel(const JobId& job) = 0;

  // Of who does it.

  struct Wish {
    std::string worker, version;
    std::chrono::milliseconds lease{15'000};  ///< how long the claim holds without a beat
    std::chrono::milliseconds left_alone{0};  ///< only what waits for so long already
    std::string kind{};                       ///< empty: any
  };
  /// The oldest that waits or whose claim has run out; nothing: there is none.
  virtual Result<std::optional<WorkClaim>> claim(const Wish& wish) = 0;
  struct Beat {
    std::chrono::milliseconds lease{};
    double fraction{};
    std::string stage, detail;
  };
  /// The claim holds for the lease from now on. True: it is to be canceled. conflict: somebody else has it
  virtual Result<bool> beat(const WorkClaim& claim, const Beat& beat) = 0;
  /// conflict, and nothing is kept: somebody else has the work.
  virtual Result<void> finish(const WorkClaim& claim, std::string_view result) = 0;
  /// An error of the work itself: nobody tries again. conflict as above
  virtual Result<void> fail(const WorkClaim& claim, const Error& error) = 0;
  /// An attempt that says nothing about the work; the last one ends it with this error. conflict as above
  virtual Result<void> retry(const WorkClaim& claim, const Error& error) = 0;
  /// Unbegun: it waits again, and the attempt does not count. conflict as above
  virtual Result<void> give_back(const WorkClaim& claim) = 0;

  /// A worker is there.
  virtual Result<void> seen(std::string_view worker, std::string_view version) = 0;
  virtual Result<void> gone(std::string_view worker) = 0;
  /// By name; those not seen for a day are forgotten.
  virtual Result<std::vector<WorkerStatus>> workers() = 0;
};

}  // namespace anchord
