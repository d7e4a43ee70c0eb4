#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/document.hpp"

namespace anchord {

/// Long work, visible and cancellable. At start the server calls fail_unfinished, for nothing runs then but
/// what other processes may do (core/ports/work_store.hpp).
enum class JobState : std::uint8_t { queued, running, succeeded, failed, canceled };
inline constexpr auto k_job_state_words = enum_table<JobState>({{"queued", JobState::queued},
                                                                {"running", JobState::running},
                                                                {"succeeded", JobState::succeeded},
                                                                {"failed", JobState::failed},
                                                                {"canceled", JobState::canceled}});
struct Job {
  JobId id{};
  std::string kind;
  JobState state{JobState::queued};
  double fraction{0};
  std::string stage, detail, result_href;
  Document problem, request;  ///< api/admin/job_service
  UtcTime created{};
  std::optional<UtcTime> started{}, finished{};
  std::string worker{};  ///< the process that runs it or ran it; empty: the server itself
  int attempts{0};       ///< how often it was begun
};

class JobStore {
 public:
  virtual ~JobStore() = default;
  virtual Result<void> insert(const Job& job) = 0;
  virtual Result<void> update(const Job& job) = 0;
  virtual Result<Job> job(const JobId& id) = 0;
  virtual Result<std::vector<Job>> jobs(std::size_t limit,
                                        const std::optional<JobId>& after) = 0;  ///< newest first
  /// Queued and running jobs without work elsewhere become failed with this problem; says how many.
  virtual Result<std::size_t> fail_unfinished(UtcTime now, const Document& problem) = 0;
};

}  // namespace anchord
