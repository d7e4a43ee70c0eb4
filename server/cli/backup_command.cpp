#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/rest_json.hpp"
#include "server/cli/server_address.hpp"
#include "server/cli/terminal_text.hpp"
#include "server/runtime/backup_keeper.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/postgres_database.hpp"

namespace anchord::cli {
namespace {

struct BackupOptions {
  std::string data_dir{"anchord-data"}, database, dir, file;
  std::size_t keep{7};
  bool without_cirs{false};
  std::filesystem::path folder() const {
    return dir.empty() ? std::filesystem::path(data_dir) / "backups" : std::filesystem::path(dir);
  }
};

/// 0; where files of impulse responses are missing from it, 1 and which.
int report_missing(const std::string& backup, const std::vector<std::string>& missing) {
  if (missing.empty()) return 0;
  std::fprintf(stderr, "anchord: %s is not complete: %zu files with impulse responses are missing from it\n",
               printable(backup).c_str(), missing.size());
  for (const auto& one : missing) std::fprintf(stderr, "  %s\n", printable(one).c_str());
  return 1;
}

void print_cirs(std::size_t files, std::uint64_t bytes) {
  if (files > 0)
    std::printf("with %zu files of impulse responses, %llu bytes\n", files,
                static_cast<unsigned long long>(bytes));
}

/// The backup that a server made.
Result<nlohmann::json> made_by(RestClient& client) {
  BOOST_OUTCOME_TRY(const auto job, post_json(client, "/api/v1/backups", nlohmann::json::object()));
  BOOST_OUTCOME_TRYV(result_of_job(client, job));
  BOOST_OUTCOME_TRY(auto list, get_json(client, "/api/v1/backups"));
  if (list["items"].empty()) return make_error(Errc::not_found, "the backup is gone again");
  return std::move(list["items"][0]);
}

/// A running server owns the folder and makes the copy itself; none when nobody answers.
std::optional<int> through_server(const BackupOptions& options) {
  const auto url = running_server(options.data_dir);
  if (!url) return std::nullopt;
  auto client = RestClient::make(*url, own_token(options.data_dir), interrupted);
  if (!client || !client.value()->get("/healthz")) return std::nullopt;  // an address left by a crash
  if (!options.dir.empty())
    return failed("anchord",
                  "a running server uses this folder and stores its backups in its backup.dir; omit --dir",
                  2);
  const auto made = made_by(*client.value());
  if (!made) return failed("anchord", made.error().message);
  std::printf("%s\n", printable_json(to_wire(made.value())).c_str());
  return report_missing(made.value().value("name", ""),
                        made.value().value("cir_missing", std::vector<std::string>{}));
}

/// Whether the rows are where no command of this file reaches.
bool elsewhere(const BackupOptions& options) {
  return !options.database.empty() || !sql::postgres_of_folder(options.data_dir).empty();
}

int make(const BackupOptions& options) {
  if (elsewhere(options)) return failed("anchord", k_postgres_backups, 2);
  if (const auto code = through_server(options)) return *code;
  StorageOptions storage;
  storage.data_dir = options.data_dir;
  if (!std::filesystem::exists(storage.data_dir / "anchord.db"))
    return failed("anchord", "there is no database in " + options.data_dir, 2);
  auto database = open_database(storage);
  if (!database) return failed("anchord", database.error().message);
  const SystemClock clock;
  server::BackupKeeper keeper(*database.value(), clock, {options.folder(), options.keep, 24, false});
  (void)interrupted();  // from here on a signal is asked for
  const auto made = keeper.make([] { return !interrupted(); });
  if (!made) return failed("anchord", made.error().message);
  std::printf("%s  %llu bytes  sha256 %s\n", (options.folder() / made.value().name).c_str(),
              static_cast<unsigned long long>(made.value().bytes), made.value().sha256_hex.c_str());
  print_cirs(made.value().cir_files, made.value().cir_bytes);
  return report_missing(made.value().name, made.value().cir_missing);
}

/// Input that cannot be used, or something that failed.
int failed_by(const Error& error) {
  const bool input = error.code == Errc::not_found || error.code == Errc::unsupported;
  return failed("anchord", error.message, input ? 2 : 1);
}

int check(const BackupOptions& options) {
  if (const auto whole = check_backup(options.file); !whole) return failed_by(whole.error());
  const auto cirs = check_backup_cirs(options.file);
  if (!cirs) return failed_by(cirs.error());
  if (!cirs.value().missing.empty()) return report_missing(options.file, cirs.value().missing);
  std::error_code ignored;
  if (std::filesystem::exists(options.file + ".sha256", ignored))
    std::printf("%s is complete\n", options.file.c_str());
  else
    std::printf("%s is a whole database; no digest was compared: %s.sha256 is not there\n",
                options.file.c_str(), options.file.c_str());
  print_cirs(cirs.value().files, cirs.value().bytes);
  return 0;
}

int restore(const BackupOptions& options) {
  if (elsewhere(options)) return failed("anchord", k_postgres_backups, 2);
  const auto restored = restore_backup(options.data_dir, options.file, options.without_cirs);
  if (!restored) return failed_by(restored.error());
  std::printf("%s is now the database of %s\n", options.file.c_str(), options.data_dir.c_str());
  if (restored.value().old)
    std::printf("the previous database is kept as %s\n", restored.value().old->c_str());
  print_cirs(restored.value().cirs.files, restored.value().cirs.bytes);
  (void)report_missing(options.file, restored.value().cirs.missing);
  return 0;
}

}  // namespace

void add_backup_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "backup",
      "Copy the database and its files of impulse responses while they are in use, check or restore "
      "a copy");
  command->require_subcommand(0, 1);
  const auto options = std::make_shared<BackupOptions>();
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
  back->add_option("file", options->file, "the backup; the folder cir-archive is beside it")->required();
  back->add_flag("--without-cir-archive", options->without_cirs,
                 "restore also where files of impulse responses are missing; what needs them then fails");
  back->callback([&exit_code, options] { exit_code = restore(*options); });
  auto* checked = command->add_subcommand(
      "check", "Read a backup whole, with the files of impulse responses that it needs, and compare digests");
  checked->add_option("file", options->file, "the backup")->required();
  checked->callback([&exit_code, options] { exit_code = check(*options); });
}

}  // namespace anchord::cli
