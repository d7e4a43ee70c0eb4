#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "api/admin/support_bundle.hpp"
#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "core/base/time.hpp"
#include "core/base/whole_file.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"
#include "server/cli/doctor.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/server_address.hpp"
#include "server/http/http_client.hpp"

namespace anchord::cli {
namespace {

struct SupportOptions {
  std::string data_dir{"anchord-data"}, database, out{"anchord-support.tar"};
};

/// What the server of this folder reports of itself; none when it does not run.
std::optional<Result<std::string>> from_server(const SupportOptions& options) {
  const auto url = running_server(options.data_dir);
  if (!url) return std::nullopt;
  auto client = server::HttpClient::to(*url, std::chrono::seconds(60));
  if (!client || !client.value().call("GET", "/healthz")) return std::nullopt;  // an address left by a crash
  if (const auto token = own_token(options.data_dir); !token.empty())
    client.value().set_header("Authorization", "Bearer " + token);
  const auto answer = client.value().call("GET", "/api/v1/support-bundle");
  if (!answer) return answer.error();
  if (answer.value().status >= 400)
    return make_error(Errc::invalid_argument, api::problem_text(answer.value().body));
  return answer.value().body;
}

/// Without a server: what can be seen from outside.
std::string from_here(const SupportOptions& options) {
  DoctorOptions look;
  look.data_dir = options.data_dir;
  look.database = options.database;
  return api::tar_of(
      {{"README.txt", "No server is running on this folder: this is what 'anchord doctor' finds.\n"},
       {"doctor.json", api::without_secrets(findings_json(examine(look)))}},
      SystemClock().now());
}

/// What is in it is for whoever asked, also where a file of this name could be read by others.
Result<void> write_private(const std::filesystem::path& file, std::string_view text) {
  umask(077);
  std::error_code none;
  if (std::filesystem::is_regular_file(file, none))
    std::filesystem::permissions(
        file, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write, none);
  return write_whole(file, text);
}

}  // namespace

void add_support_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("support-bundle",
                                     "Collect versions, settings, log, metrics, events and the findings of "
                                     "anchord doctor in one archive, without secrets");
  const auto options = std::make_shared<SupportOptions>();
  command->add_option("--data-dir", options->data_dir, "folder of the database [anchord-data]")
      ->envname("ANCHORD_DATA_DIR");
  add_database_option(*command, options->database);
  command->add_option("--out", options->out, "the archive to write [anchord-support.tar]");
  command->callback([&exit_code, options] {
    const auto served = from_server(*options);
    if (served && !*served) {
      std::fprintf(stderr, "anchord: %s\n", printable(served->error().message).c_str());
      exit_code = 1;
      return;
    }
    const auto written = write_private(options->out, served ? served->value() : from_here(*options));
    if (!written) {
      exit_code =
          failed("anchord support-bundle", written.error().message + "; give another file with --out");
      return;
    }
    std::printf("%s\n", options->out.c_str());
  });
}

}  // namespace anchord::cli
