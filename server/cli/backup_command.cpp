#include <CLI/CLI.hpp>
#include <cstdio>

#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"
#include "server/cli/server_address.hpp"
#include "server/http/http_client.hpp"
#include "server/runtime/backup_keeper.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/postgres_database.hpp"

namespace anchord::cli {
namespace {

struct Options {
  std::string data_dir{"anchord-data"}, database, dir, file;
  std::size_t keep{7};
  std::filesystem::path folder() const {
    return dir.empty() ? std::filesystem::path(data_dir) / "backups" : std::filesystem::path(dir);
  }
};

int fail(const std::string& message, int code = 1) {
  std::fprintf(stderr, "anchord: %s\n", printable(message).c_str());
  return code;
}

/// A running server owns the folder and makes the copy itself; none when nobody answers.
std::optional<int> through_server(const Options& options) {
  const auto url = running_server(options.data_dir);
  if (!url) return std::nullopt;
  auto client = server::HttpClient::to(*url, std::chrono::seconds(620));
  if (!client || !client.value().call("GET", "/healthz")) return std::nullopt;  // an address left by a crash
  if (!options.dir.empty())
    return fail("a running server uses this folder and stores its backups in its backup.dir; omit --dir", 2);
  if (const auto token = own_token(options.data_dir); !token.empty())
    client.value().set_header("Authorization", "Bearer " + token);
  client.value().set_header("Prefer", "wait=600");
  const auto answer = client.value().call("POST", "/api/v1/backups");
  if (!answer) return fail(answer.error().message);
  if (answer.value().status >= 400) return fail(api::problem_text(answer.value().body));
  std::printf("%s\n", answer.value().body.c_str());
  return 0;
}

/// Whether the rows are where no command of this file reaches.
bool elsewhere(const Options& options) {
  return !options.database.empty() || !sql::postgres_of_folder(options.data_dir).empty();
}

int make(const Options& options) {
  if (elsewhere(options)) return fail(k_postgres_backups, 2);
  if (const auto code = through_server(options)) return *code;
  StorageOptions storage;
  storage.data_dir = options.data_dir;
  if (!std::filesystem::exists(storage.data_dir / "anchord.db"))
    return fail("there is no database in " + options.data_dir, 2);
  auto database = open_database(storage);
  if (!database) return fail(database.error().message);
  const SystemClock clock;
  server::BackupKeeper keeper(*database.value(), clock, {options.folder(), options.keep, 24, false, nullptr});
  const auto made = keeper.make();
  if (!made) return fail(made.error().message);
  std::printf("%s  %llu bytes  sha256 %s\n", (options.folder() / made.value().name).c_str(),
              static_cast<unsigned long long>(made.value().bytes), made.value().sha256_hex.c_str());
  return 0;
}

int restore(const Options& options) {
  if (elsewhere(options)) return fail(k_postgres_backups, 2);
  const auto old = restore_backup(options.data_dir, options.file);
  if (!old) {
    const bool input = old.error().code == Errc::not_found || old.error().code == Errc::unsupported;
    return fail(old.error().message, input ? 2 : 1);
  }
  std::printf("%s is now the database of %s\n", options.file.c_str(), options.data_dir.c_str());
  if (old.value()) std::printf("the previous database is kept as %s\n", old.value()->c_str());
  return 0;
}

}  // namespace

void add_backup_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("backup", "Copy the database while it is in use, or restore a copy");
  command->require_subcommand(0, 1);
  const auto options = std::make_shared<Options>();
  const auto common = [&](CLI::App* sub) {
    sub->add_option("--data-dir", options->data_dir, "folder of the database [anchord-data]")
        ->envname("ANCHORD_DATA_DIR");
    add_database_option(*sub, options->database);
  };
  common(command);
  command->add_option("--dir", options->dir,
                      "folder for the backup when no server is running [DATA_DIR/backups]");
  command->add_option("--keep", options->keep, "number of intact backups to keep there, at least 7")
      ->check(CLI::Range(1, 10'000));
  command->callback([&exit_code, options, command] {
    if (command->get_subcommands().empty()) exit_code = make(*options);
  });
  auto* back =
      command->add_subcommand("restore", "Replace the database by a backup; the server must not be running");
  common(back);
  back->add_option("file", options->file, "the backup")->required();
  back->callback([&exit_code, options] { exit_code = restore(*options); });
}

}  // namespace anchord::cli
