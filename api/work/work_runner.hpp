#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "api/work/worker_port.hpp"
#include "core/ports/work_store.hpp"

namespace anchord::api {

/// Claims work of the database, runs it and stores what came out, for the server and for `anchord worker`
/// alike. While it runs the claim is renewed five times a lease; who finds that another one has it stops.
/// A database that is away ends nothing: the work goes on, and its result waits for it.
class WorkRunner {
 public:
  struct Deps {
    WorkStore& work;
    RunWork run;
    std::string worker, version;
    std::chrono::milliseconds lease{15'000};
    bool announced{true};  ///< also shows itself among the workers while it works
    /// What happened to a claim, for the log; `why` may be empty.
    std::function<void(std::string_view what, const WorkClaim& claim, std::string_view why)> log;
  };
  explicit WorkRunner(Deps deps) : deps_(std::move(deps)) {}

  /// One work from its claim to its end. False: there was none. Blocks.
  /// left_alone  only what waits for so long already
  /// stopping    asked often; true: the work is given back and begins anew elsewhere
  /// kind        of the work; empty: any
  /// errors      those of the store, before anything was claimed
  Result<bool> run_one(std::chrono::milliseconds left_alone, const std::function<bool()>& stopping,
                       const std::string& kind = {});

 private:
  void run(const WorkClaim& claim, const std::function<bool()>& stopping);
  /// Until the database has taken it, has refused it, or we are to stop.
  void settle(const WorkClaim& claim, std::string_view what, const std::function<bool()>& stopping,
              const std::function<Result<void>()>& store);
  Deps deps_;
};

}  // namespace anchord::api
