#include "server/storage/cir_copies.hpp"

#include <algorithm>
#include <fstream>
#include <set>

#include "core/base/sha256.hpp"
#include "server/storage/backup.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/sqlite_connection.hpp"

namespace anchord::sql {
namespace {

namespace fs = std::filesystem;

constexpr const char* k_needed =
    "SELECT m.id, a.file, a.sha256_hex, a.file_bytes FROM cir_archive a JOIN mission m ON m.mission_key = "
    "a.mission_key WHERE a.n_moved > 0 ORDER BY m.mission_key";
constexpr int k_first_version = 18;  ///< of a database with the table
constexpr const char *k_folder = "cir-archive", *k_digest = ".sha256", *k_copy_part = ".part";
/// As a backup leaves it.
constexpr std::uint64_t k_keep_free_bytes = 500ULL << 20;

std::uint64_t size_of(const fs::path& file) {
  std::error_code error;
  const auto bytes = fs::file_size(file, error);
  return error ? 0 : bytes;
}

/// Of a flight and as long as it, the one of its name first.
std::vector<fs::path> candidates(const CirFolder& folder, const NeededCirFile& needed) {
  auto files = folder.files(needed.mission);
  std::erase_if(files, [&](const fs::path& file) { return size_of(file) != needed.bytes; });
  std::ranges::stable_partition(files, [&](const fs::path& file) { return file.filename() == needed.file; });
  return files;
}

std::string listed_digest(const fs::path& file) {
  std::string digest;
  std::ifstream(file.string() + k_digest) >> digest;
  return digest;
}

Result<void> write_bytes(const fs::path& from, const fs::path& part, const std::function<bool()>& go_on) {
  std::ifstream in(from, std::ios::binary);
  std::ofstream out(part, std::ios::binary | std::ios::trunc);
  std::vector<char> chunk(1 << 20);
  while (in && out) {
    if (!go_on()) return make_error(Errc::canceled, "stopped; the same call goes on");
    in.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    out.write(chunk.data(), in.gcount());
  }
  if (!in.eof()) return make_error(Errc::storage_unavailable, from.string() + " cannot be read");
  out.close();
  if (out) return boost::outcome_v2::success();
  return make_error(Errc::storage_unavailable, part.string() + " cannot be written");
}

Result<void> write_digest(const fs::path& file, const std::string& sha256_hex) {
  std::ofstream(file.string() + k_digest) << sha256_hex << "  " << file.filename().string() << '\n';
  return sync_path(file.string() + k_digest);
}

struct Way {
  const CirFolder& to;
  const std::function<bool()>& go_on;
  bool listed{};  ///< its SHA-256 is written beside it
};

Result<fs::path> copy_one(const fs::path& from, const NeededCirFile& needed, const Way& way) {
  const CirFolder& to = way.to;
  std::error_code error;
  // Not by the name in the backup, which whoever made that wrote and which may lead out of the folder.
  const fs::path file = to.next(needed.mission);
  const fs::path part = file.string() + k_copy_part;
  auto done = write_bytes(from, part, way.go_on);
  if (done) done = sync_path(part);
  if (done) {
    auto digest = sha256_of_file(part);
    if (!digest)
      done = std::move(digest).error();
    else if (digest.value() != needed.sha256_hex)
      done = make_error(Errc::storage_unavailable, from.string() + " is damaged: its SHA-256 differs");
  }
  if (done && way.listed) done = write_digest(file, needed.sha256_hex);
  if (done) {
    fs::rename(part, file, error);
    if (error) done = make_error(Errc::storage_unavailable, file.string() + ": " + error.message());
  }
  if (done) done = sync_path(to.dir());
  if (done) return file;
  fs::remove(part, error);
  return std::move(done).error();
}

/// From the first file that is what it should be.
Result<fs::path> copy_any(const CirFolder& from, const NeededCirFile& needed, const Way& way) {
  const auto named = needed.file + " of mission " + to_string(needed.mission);
  const auto files = candidates(from, needed);
  if (files.empty())
    return make_error(Errc::not_found, named + (from.dir().empty() ? ", whose folder was not named"
                                                                   : " is not in " + from.dir().string()));
  std::error_code error;
  const auto space = fs::space(way.to.dir(), error);
  if (!error && space.available < needed.bytes + k_keep_free_bytes)
    return make_error(Errc::storage_full,
                      named + " was not copied: less than 500 MiB would be free in " + way.to.dir().string());
  for (const auto& file : files) {
    auto copied = copy_one(file, needed, way);
    if (copied || copied.error().code == Errc::canceled || &file == &files.back()) return copied;
  }
  return make_error(Errc::internal, named);  // not reached: there is a last one
}

}  // namespace

std::vector<NeededCirFile> needed_cir_files(Connection& connection) {
  Query query(connection, k_needed);
  std::vector<NeededCirFile> out;
  while (query.step()) {
    NeededCirFile& one = out.emplace_back();
    one.mission = query.id<MissionId>();
    one.file = query.text();
    one.sha256_hex = query.text();
    one.bytes = query.as<std::uint64_t>();
  }
  return out;
}

Result<std::vector<NeededCirFile>> needed_by_backup(const fs::path& backup) {
  try {
    SqliteConnection copy(backup, SqliteConnection::Mode::inspect, Synchronous::full, std::nullopt);
    if (copy.pragma("user_version") < k_first_version) return std::vector<NeededCirFile>{};
    return needed_cir_files(copy);
  } catch (const SqlError& error) {
    return make_error(Errc::unsupported, backup.string() + " cannot be read: " + error.what());
  }
}

CirFolder copies_beside(const fs::path& backup) {
  return CirFolder(fs::absolute(backup).parent_path() / k_folder);
}

std::optional<fs::path> read_cir_file(const CirFolder& folder, const NeededCirFile& needed) {
  for (const auto& file : candidates(folder, needed)) {
    const auto digest = sha256_of_file(file);
    if (digest && digest.value() == needed.sha256_hex) return file;
  }
  return std::nullopt;
}

std::optional<fs::path> listed_cir_file(const CirFolder& folder, const NeededCirFile& needed) {
  for (const auto& file : candidates(folder, needed))
    if (listed_digest(file) == needed.sha256_hex) return file;
  return std::nullopt;
}

Result<BroughtCirFiles> bring_cir_files(const std::vector<NeededCirFile>& needed, const CirFolder& from,
                                        const CirFolder& to, Found found,
                                        const std::function<bool()>& go_on) {
  BroughtCirFiles out;
  if (needed.empty()) return out;
  std::error_code error;
  fs::create_directories(to.dir(), error);
  if (error) return make_error(Errc::storage_unavailable, to.dir().string() + ": " + error.message());
  BOOST_OUTCOME_TRYV(sync_path(fs::absolute(to.dir()).parent_path()));
  const Way way{to, go_on, found == Found::listed};
  for (const auto& one : needed) {
    if (!go_on()) return make_error(Errc::canceled, "stopped; the same call goes on");
    auto there = found == Found::listed ? listed_cir_file(to, one) : read_cir_file(to, one);
    if (!there) {
      auto copied = copy_any(from, one, way);
      if (!copied && copied.error().code == Errc::canceled) return std::move(copied).error();
      if (!copied) {
        out.report.missing.push_back(std::move(copied).error().message);
        out.files.emplace_back();
        continue;
      }
      there = std::move(copied).value();
      out.made.push_back(*there);
    }
    ++out.report.files;
    out.report.bytes += one.bytes;
    out.files.push_back(*std::move(there));
  }
  return out;
}

Result<void> write_backup_list(const BackupReport& report, const fs::path& file,
                               const std::vector<NeededCirFile>& needed, const BroughtCirFiles& brought) {
  const fs::path list = file.string() + k_digest;
  {
    std::ofstream out(list);
    out << report.sha256_hex << "  " << file.filename().string() << '\n';
    for (std::size_t i = 0; i < needed.size(); ++i) {
      const auto name = brought.files[i].empty() ? fs::path(needed[i].file) : brought.files[i].filename();
      out << needed[i].sha256_hex << "  " << (k_folder / name).string() << '\n';
    }
  }
  return sync_path(list);
}

void drop_unneeded_copies(const fs::path& backups) {
  const CirFolder copies = copies_beside(backups / "any");
  std::set<fs::path> needed;
  std::error_code error;
  for (fs::directory_iterator it(backups, error), end; !error && it != end; it.increment(error)) {
    if (it->path().extension() != ".db") continue;
    const auto files = needed_by_backup(it->path());
    if (!files) return;
    for (const auto& one : files.value())
      if (const auto file = listed_cir_file(copies, one)) needed.insert(file->filename());
  }
  if (error) return;
  for (fs::directory_iterator it(copies.dir(), error), end; !error && it != end; it.increment(error)) {
    const fs::path file = it->path();
    if (file.extension() != ".db" || needed.contains(file.filename())) continue;
    std::error_code ignored;
    fs::remove(file, ignored);
    fs::remove(file.string() + k_digest, ignored);
  }
}

}  // namespace anchord::sql

namespace anchord {

namespace fs = std::filesystem;

CirCopies listed_backup_cirs(const fs::path& backup) {
  CirCopies out;
  std::ifstream list(backup.string() + sql::k_digest);
  std::string digest, name;
  for (bool first = true; list >> digest >> name; first = false) {
    if (first) continue;  // the database
    const auto file = backup.parent_path() / name;
    if (sql::listed_digest(file) == digest && fs::exists(file)) {
      ++out.files;
      out.bytes += sql::size_of(file);
    } else {
      out.missing.push_back(name + " is missing");
    }
  }
  return out;
}

Result<CirCopies> check_backup_cirs(const fs::path& backup) {
  BOOST_OUTCOME_TRY(const auto needed, sql::needed_by_backup(backup));
  const auto copies = sql::copies_beside(backup);
  CirCopies out;
  for (const auto& one : needed) {
    if (!sql::read_cir_file(copies, one)) {
      out.missing.push_back(one.file + " of mission " + to_string(one.mission) + " is not in " +
                            copies.dir().string() + ", or damaged there");
      continue;
    }
    ++out.files;
    out.bytes += one.bytes;
  }
  return out;
}

}  // namespace anchord
