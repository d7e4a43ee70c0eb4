#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/progress.hpp"
#include "server/storage/database_copy.hpp"

namespace anchord::cli {
namespace {

struct DatabaseOptions {
  std::string from, to;
  CopyFolders folders;
};

int failed_by_database(const Error& error) {
  const bool input = error.code == Errc::invalid_argument || error.code == Errc::not_found ||
                     error.code == Errc::unsupported;
  return failed("anchord", error.message, input ? 2 : 1);
}

void print(const sql::TableDigest& table) {
  std::printf("%-28s %10llu  %s\n", table.table.c_str(), static_cast<unsigned long long>(table.rows),
              table.sha256_hex.c_str());
}

void say_served(const std::string& shown, const std::string& server) {
  std::fprintf(stderr,
               "anchord: server %s has %s and writes into it: what it stores from now on is left out\n",
               printable(server).c_str(), printable(shown).c_str());
}

int migrate(const DatabaseOptions& options) {
  const auto version = migrate_database(options.from);
  if (!version) return failed_by_database(version.error());
  std::printf("version %d\n", version.value());
  return 0;
}

int check_databases(const DatabaseOptions& options) {
  const auto here = digest_database(options.from, say_served);
  if (!here) return failed_by_database(here.error());
  if (options.to.empty()) {
    for (const auto& table : here.value()) print(table);
    return 0;
  }
  const auto there = digest_database(options.to, say_served);
  if (!there) return failed_by_database(there.error());
  int differ = 0;
  for (std::size_t i = 0; i < here.value().size(); ++i) {
    const auto& one = here.value()[i];
    const auto& other = there.value()[i];
    if (one == other) continue;
    ++differ;
    std::printf("%-28s %10llu rows, there %llu\n", one.table.c_str(),
                static_cast<unsigned long long>(one.rows), static_cast<unsigned long long>(other.rows));
  }
  std::printf("%zu tables, %d differ\n", here.value().size(), differ);
  return differ == 0 ? 0 : 1;
}

int copy(const DatabaseOptions& options) {
  (void)interrupted();
  std::string told;
  const auto progress = [&](const std::string& table, std::uint64_t) {
    if (table != told) std::fprintf(stderr, "%s\n", table.c_str());
    told = table;
    return !interrupted();
  };
  const auto done = copy_database(options.from, options.to, options.folders, progress, say_served);
  if (!done) return failed_by_database(done.error());
  for (const auto& table : done.value().tables) print(table);
  const CirCopies& cirs = done.value().cirs;
  if (cirs.files > 0)
    std::printf("%zu files of impulse responses, %llu bytes, in %s\n", cirs.files,
                static_cast<unsigned long long>(cirs.bytes), done.value().cir_archive.c_str());
  for (const auto& one : cirs.missing)
    std::fprintf(stderr, "anchord: copied without %s\n", printable(one).c_str());
  return 0;
}

}  // namespace

void add_database_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "database", "Migrate, compare and copy whole databases: SQLite folders and PostgreSQL");
  command->require_subcommand(1);
  const auto options = std::make_shared<DatabaseOptions>();
  const char* place = "data folder, or postgresql://user@host/name";
  auto* migrated = command->add_subcommand("migrate", "Migrate a database to the newest version");
  migrated->add_option("database", options->from, place)->required();
  migrated->callback([&exit_code, options] { exit_code = migrate(*options); });
  auto* checked =
      command->add_subcommand("check", "Print rows and digest of each table, or compare two databases");
  checked->add_option("database", options->from, place)->required();
  checked->add_option("other", options->to, "database to compare with");
  checked->callback([&exit_code, options] { exit_code = check_databases(*options); });
  auto* copied = command->add_subcommand(
      "copy",
      "Copy all rows and their files of impulse responses into an empty database and compare; the same "
      "command resumes an interrupted copy");
  copied->add_option("from", options->from, place)->required();
  copied->add_option("to", options->to, place)->required();
  copied->add_option("--from-data-dir", options->folders.from,
                     "data folder of the server whose rows are in PostgreSQL, with its cir-archive");
  copied->add_option(
      "--to-data-dir", options->folders.to,
      "data folder that the server on the copied PostgreSQL will have [the folder copied from]");
  copied->add_flag("--without-cir-archive", options->folders.without_cirs,
                   "copy also where files of impulse responses are missing");
  copied->callback([&exit_code, options] { exit_code = copy(*options); });
}

}  // namespace anchord::cli
