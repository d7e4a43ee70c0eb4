#include <signal.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <memory>

#include "core/base/guard.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/signals.hpp"
#include "server/runtime/database_worker.hpp"
#include "server/runtime/logging.hpp"
#include "server/runtime/service_manager.hpp"
#include "server/runtime/worker_process.hpp"

namespace anchord::cli {
namespace {

struct WorkerOptions {
  server::DatabaseWorkerOptions worker;
  double lease_s{15};
  std::string log_level{"info"};
};

int run_worker(WorkerOptions& options) {
  block_signals({SIGTERM, SIGINT});
  server::start_logging(options.log_level);
  static std::atomic<bool> stop{false};  // the thread below may outlive this call
  Thread("anchord-signal", [] {
    (void)wait_for_signal({SIGTERM, SIGINT});
    (void)server::notify_service_manager("STOPPING=1");
    stop = true;
  }).detach();
  auto& w = options.worker;
  w.version = ANCHORD_VERSION;
  w.lease = std::chrono::milliseconds(std::llround(options.lease_s * 1000));
  if (w.name.empty()) w.name = server::worker_name();
  const auto worked = server::work_for_database(
      w, [] { (void)server::notify_service_manager("READY=1"); }, [] { return stop.load(); });
  if (!worked) {
    std::fprintf(stderr, "anchord worker: %s\n", printable(worked.error().message).c_str());
    const auto code = worked.error().code;
    return code == Errc::invalid_argument || code == Errc::unsupported ? 2 : 1;
  }
  server::log(server::LogLevel::info, "stopped");
  return 0;
}

}  // namespace

void add_worker_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "worker",
      "Run calibrations and training runs of a server on this machine: with --database of its PostgreSQL. "
      "Without --database this is the process that a server starts by itself");
  const auto options = std::make_shared<WorkerOptions>();
  command
      ->add_option(
          "--database", options->worker.database,
          "PostgreSQL of the server, like postgresql://anchord_worker@host/name; see docs/workers.md")
      ->envname("ANCHORD_DATABASE");
  command->add_option("--name", options->worker.name,
                      "name that is shown with its jobs; a different one for each worker [HOST/PROCESS]");
  command
      ->add_option(
          "--lease-s", options->lease_s,
          "seconds without a sign of life of this worker after which another one takes over its job [15]")
      ->check(CLI::Range(1.0, 3600.0));
  command->add_option("--log-level", options->log_level, "debug, info, warning or error [info]")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}));
  command->callback([&exit_code, options] {
    exit_code = options->worker.database.empty() ? server::worker_main() : run_worker(*options);
  });
}

}  // namespace anchord::cli
