#include "api/work/work_runner.hpp"

#include <optional>
#include <thread>

namespace anchord::api {
namespace {

using Steady = std::chrono::steady_clock;

constexpr int k_beats_a_lease = 5;
constexpr auto k_store_again = std::chrono::milliseconds(500);

bool database_away(const Error& error) {
  return error.code == Errc::storage_unavailable || error.code == Errc::storage_full;
}

/// Says nothing about the work: its process died, or could not be started. Elsewhere it may go well.
bool of_the_machine(const Error& error) { return error.code == Errc::link_lost; }

}  // namespace

Result<bool> WorkRunner::run_one(std::chrono::milliseconds left_alone, const std::function<bool()>& stopping,
                                 const std::string& kind) {
  if (stopping()) return false;
  BOOST_OUTCOME_TRY(const auto claim,
                    deps_.work.claim({deps_.worker, deps_.version, deps_.lease, left_alone, kind}));
  if (!claim) return false;
  deps_.log("job claimed", *claim, "");
  run(*claim, stopping);
  return true;
}

void WorkRunner::run(const WorkClaim& claim, const std::function<bool()>& stopping) {
  WorkProgress seen;
  bool canceled = false;
  std::optional<Error> lost;
  auto last = Steady::now();
  const auto beat = [&] {
    if (Steady::now() - last < deps_.lease / k_beats_a_lease) return;
    last = Steady::now();
    const auto held = deps_.work.beat(claim, {deps_.lease, seen.fraction, seen.stage, seen.detail});
    if (held)
      canceled = held.value();
    else if (held.error().code == Errc::conflict)
      lost = held.error();
    if (deps_.announced) (void)deps_.work.seen(deps_.worker, deps_.version).has_value();
  };
  const auto answer = deps_.run(
      claim.message, [&](const WorkProgress& p) { seen = p; },
      [&] {
        if (!lost && !canceled) beat();
        return lost || canceled || stopping();
      });
  if (lost) {
    deps_.log("job taken over", claim, lost->message);
    return;
  }
  auto& work = deps_.work;
  if (answer) return settle(claim, "job done", stopping, [&] { return work.finish(claim, answer.value()); });
  const Error& error = answer.error();
  if (error.code == Errc::canceled && !canceled)
    return settle(claim, "job given back", stopping, [&] { return work.give_back(claim); });
  if (of_the_machine(error))
    return settle(claim, "attempt failed", stopping, [&] { return work.retry(claim, error); });
  settle(claim, canceled ? "job canceled" : "job failed", stopping, [&] { return work.fail(claim, error); });
}

void WorkRunner::settle(const WorkClaim& claim, std::string_view what, const std::function<bool()>& stopping,
                        const std::function<Result<void>()>& store) {
  while (true) {
    const auto stored = store();
    if (stored) return deps_.log(what, claim, "");
    if (stored.error().code == Errc::conflict)
      return deps_.log("job was taken over by another worker, nothing is stored", claim,
                       stored.error().message);
    if (!database_away(stored.error())) {
      deps_.log("result rejected by the database", claim, stored.error().message);
      (void)deps_.work.fail(claim, stored.error()).has_value();
      return;
    }
    // Nobody waits for a database that is away when it is time to go: the lease runs out, another begins
    // anew.
    if (stopping())
      return deps_.log("database not reachable, nothing is stored", claim, stored.error().message);
    std::this_thread::sleep_for(k_store_again);
  }
}

}  // namespace anchord::api
