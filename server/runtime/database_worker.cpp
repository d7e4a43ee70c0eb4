#include "server/runtime/database_worker.hpp"

#include <unistd.h>

#include <array>
#include <thread>

#include "api/work/work_runner.hpp"
#include "server/runtime/logging.hpp"
#include "server/runtime/worker_process.hpp"
#include "server/storage/work_store.hpp"

namespace anchord::server {
namespace {

using Steady = std::chrono::steady_clock;

constexpr auto k_look_every = std::chrono::seconds(1), k_show_every = std::chrono::seconds(3);

void pause(const std::function<bool()>& stopping) {
  for (const auto end = Steady::now() + k_look_every; Steady::now() < end && !stopping();)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
}

}  // namespace

std::string worker_name() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0 || host[0] == '\0') host[0] = '?';
  return std::string(host.data()) + "/" + std::to_string(::getpid());
}

Result<void> work_for_database(const DatabaseWorkerOptions& options, const std::function<void()>& ready,
                               const std::function<bool()>& stopping) {
  BOOST_OUTCOME_TRY(const auto work, open_work(options.database));
  BOOST_OUTCOME_TRYV(work->seen(options.name, options.version));
  log(LogLevel::info, "waiting for jobs", {{"worker", options.name}, {"version", options.version}});
  ready();
  api::WorkRunner runner({*work, work_in_process(), options.name, options.version, options.lease, true,
                          [](std::string_view what, const WorkClaim& claim, std::string_view why) {
                            log(why.empty() ? LogLevel::info : LogLevel::warning, what,
                                {{"job", to_string(claim.job)},
                                 {"kind", claim.kind},
                                 {"attempt", std::to_string(claim.attempt)},
                                 {"why", why}});
                          }});
  auto shown = Steady::now();
  bool away = false;
  while (!stopping()) {
    if (Steady::now() - shown >= k_show_every) {
      shown = Steady::now();
      (void)work->seen(options.name, options.version).has_value();
    }
    const auto ran = runner.run_one(std::chrono::milliseconds(0), stopping);
    if (!ran && !away)
      log(LogLevel::warning, "the database cannot be reached", {{"why", ran.error().message}});
    if (ran && away) log(LogLevel::info, "the database can be reached again");
    away = !ran;
    if (!ran || !ran.value()) pause(stopping);
  }
  (void)work->gone(options.name).has_value();
  return boost::outcome_v2::success();
}

}  // namespace anchord::server
