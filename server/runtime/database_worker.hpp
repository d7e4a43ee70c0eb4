#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "core/base/result.hpp"

namespace anchord::server {

struct DatabaseWorkerOptions {
  std::string database{};                   ///< address of PostgreSQL
  std::string name{};                       ///< shown with its jobs; one for each worker
  std::string version{};                    ///< of anchord: only jobs of servers of the same one are claimed
  std::chrono::milliseconds lease{15'000};  ///< without a sign for so long, its job is another's
};

/// "host/process": of this process, and of no other that runs now.
std::string worker_name();

/// Claims and runs jobs of a database until told to stop, each in a child process, one at a time. A job that
/// runs then is given back. Says in the log what it does. A database that goes away is waited for.
/// ready     called once, when the database was reached
/// stopping  asked several times a second
/// errors    before the first claim: those of open_work()
Result<void> work_for_database(const DatabaseWorkerOptions& options, const std::function<void()>& ready,
                               const std::function<bool()>& stopping);

}  // namespace anchord::server
