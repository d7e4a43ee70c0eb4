#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/doctor.hpp"
#include "server/cli/server_address.hpp"
#include "server/http/http_client.hpp"
#include "server/runtime/database_worker.hpp"
#include "server/storage/postgres_database.hpp"
#include "server/storage/work_store.hpp"

namespace anchord::cli {
namespace {

struct HealthcheckOptions {
  std::string url, data_dir{"anchord-data"}, database;
  bool worker{false};
};

int unhealthy(const std::string& why, int code = 1) {
  std::fprintf(stderr, "%s\n", printable(why).c_str());
  return code;
}

/// Servers and workers are named "host/process" in the database.
bool of_this_machine(const std::string& name) {
  const auto own = server::worker_name();
  return name.starts_with(own.substr(0, own.rfind('/') + 1));
}

/// A server that stands by does not answer itself, and is in order all the same.
int check_standby(const HealthcheckOptions& options, const std::string& why_not_ready) {
  if (options.database.empty()) return unhealthy(why_not_ready);
  const auto facts = look_at_postgres(options.database);
  if (!facts) return unhealthy(why_not_ready + "; " + facts.error().message);
  if (!of_this_machine(facts.value().standby)) return unhealthy(why_not_ready);
  if (facts.value().server.empty())
    return unhealthy(
        "this server stands by, no server has the database, and it cannot take over: see its log");
  std::printf("standing by for %s\n", printable(facts.value().server).c_str());
  return 0;
}

int check_server(const HealthcheckOptions& options) {
  const std::string address =
      !options.url.empty() ? options.url : running_server(options.data_dir).value_or("http://127.0.0.1:8420");
  auto client = server::HttpClient::to(address, std::chrono::seconds(5));
  if (!client) return unhealthy(client.error().message);
  const auto answer = client.value().call("GET", "/readyz");
  if (!answer) return check_standby(options, answer.error().message);
  if (answer.value().status != 200) return check_standby(options, answer.value().body);
  std::printf("%s\n", answer.value().body.c_str());
  return 0;
}

int check_worker(const HealthcheckOptions& options) {
  if (options.database.empty()) return unhealthy("anchord: --worker: give --database", 2);
  const auto work = open_work(options.database);
  if (!work) return unhealthy(work.error().message);
  const auto workers = work.value()->workers();
  if (!workers) return unhealthy(workers.error().message);
  const auto it = std::ranges::find_if(workers.value(), [](const auto& one) {
    return of_this_machine(one.name) && one.seen_s_ago < k_worker_silent_s;
  });
  if (it == workers.value().end()) return unhealthy("no worker of this machine was seen in the last minute");
  std::printf("worker %s\n", printable(it->name).c_str());
  return 0;
}

}  // namespace

void add_healthcheck_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("healthcheck",
                                     "Check whether a running server is ready (exit code 0: ready, 1: not)");
  const auto options = std::make_shared<HealthcheckOptions>();
  command->add_option("--url", options->url, "address of the server [the server of the data folder]");
  command->add_option("--data-dir", options->data_dir, "folder of the database [anchord-data]")
      ->envname("ANCHORD_DATA_DIR");
  command
      ->add_option("--database", options->database,
                   "PostgreSQL of the server: one of this machine that stands by is in order too")
      ->envname("ANCHORD_DATABASE");
  command->add_flag("--worker", options->worker,
                    "check a worker of this machine in --database instead: named by default, seen within a "
                    "minute");
  command->callback([&exit_code, options] {
    exit_code = options->worker ? check_worker(*options) : check_server(*options);
  });
}

}  // namespace anchord::cli
