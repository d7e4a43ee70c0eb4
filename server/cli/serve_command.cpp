#include <signal.h>
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "server/app/app.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"
#include "server/cli/doctor.hpp"
#include "server/cli/signals.hpp"
#include "server/runtime/logging.hpp"
#include "server/runtime/service_manager.hpp"

namespace anchord::cli {
namespace {

constexpr auto k_end_within = std::chrono::seconds(10);

/// One that another server has taken over from can store nothing more, and what it still waits for may never
/// answer: a commit whose standby is away, a database that is cut off. It must end to be started again.
class LastResort {
 public:
  explicit LastResort(bool armed) {
    if (!armed) return;
    thread_ = Thread("anchord-end", [this] {
      auto ended = ended_.lock();
      if (ended.wait_for(wake_, k_end_within, [](bool done) { return done; })) return;
      server::log(server::LogLevel::error, "ended without what it waited for: the database does not answer");
      // The log is written by another thread.
      (void)ended.wait_for(wake_, std::chrono::seconds(1), [](bool done) { return done; });
      std::_Exit(1);
    });
  }
  ~LastResort() {
    if (!thread_.joinable()) return;
    {
      auto ended = ended_.lock();
      *ended = true;
    }
    wake_.notify_all();
    thread_.join();
  }
  LastResort(const LastResort&) = delete;
  LastResort& operator=(const LastResort&) = delete;

 private:
  Locked<bool> ended_;
  std::condition_variable wake_;
  Thread thread_;
};

int serve(const server::Config& config) {
  block_signals({SIGTERM, SIGINT, SIGHUP});
  umask(077);  // the database holds tokens and positions

  server::start_logging(config.text("log_level"));
  for (const auto& warning : config.warnings) server::log(server::LogLevel::warning, warning);
  DoctorOptions look;
  look.data_dir = config.text("data_dir");
  look.database = config.text("database");
  look.listen = config.list("listen");
  look.tls_certificate = config.text("tls.certificate");
  look.tls_key = config.text("tls.key");
  const server::App::Waiting waiting{[] {
                                       return signal_waits({SIGTERM, SIGINT});
                                     },
                                     [] { (void)server::notify_service_manager("READY=1"); }};
  auto app = server::App::start(
      config, [look] { return findings_json(examine(look)); }, waiting);
  if (!app && app.error().code == Errc::canceled) {
    server::log(server::LogLevel::info, "stopped");
    return 0;
  }
  if (!app) {
    std::fprintf(stderr, "anchord: %s\n", printable(app.error().message).c_str());
    return app.error().code == Errc::invalid_argument ? 2 : 1;
  }
  if (!server::notify_service_manager("READY=1"))
    server::log(server::LogLevel::warning, "the service manager at NOTIFY_SOCKET could not be reached");
  int received = 0;
  for (;;) {
    received = wait_for_signal({SIGTERM, SIGINT, SIGHUP});
    if (received != SIGHUP) break;
    server::log(server::LogLevel::info, "reloading", {{"signal", "SIGHUP"}});
    app.value()->reload();
  }
  server::log(server::LogLevel::info, "stopping", {{"signal", received == SIGINT ? "SIGINT" : "SIGTERM"}});
  (void)server::notify_service_manager("STOPPING=1");
  {
    const LastResort last(app.value()->taken_over());
    app.value()->stop();
  }
  server::log(server::LogLevel::info, "stopped");
  return app.value()->taken_over() ? 1 : 0;
}

}  // namespace

void add_serve_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("serve", "Run the server");
  const auto flags = add_config_flags(*command);
  command->callback([&exit_code, flags] {
    const auto config = flags->load();
    if (!config) {
      std::fprintf(stderr, "anchord: %s\n", printable(config.error().message).c_str());
      exit_code = 2;
      return;
    }
    exit_code = serve(config.value());
  });
}

}  // namespace anchord::cli
