#include "server/runtime/backup_keeper.hpp"

#include <algorithm>
#include <fstream>
#include <optional>

#include "server/storage/sqlite_database.hpp"

namespace anchord::server {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view k_prefix = "anchord-", k_suffix = "Z.db";
// At most one in ten minutes, failed ones and days of many short flights included.
constexpr std::int64_t k_pause_ns = 600'000'000'000, k_look_ns = 2'000'000'000;

/// anchord-2026-11-21T08-30-00.123456Z.db: no colons, which some file systems refuse.
std::string name_of(UtcTime time) {
  std::string text = to_rfc3339(time);
  std::ranges::replace(text, ':', '-');
  return std::string(k_prefix) + text + ".db";
}

std::optional<UtcTime> time_of(const std::string& name) {
  if (!name.starts_with(k_prefix) || !name.ends_with(k_suffix)) return std::nullopt;
  std::string text = name.substr(k_prefix.size(), name.size() - k_prefix.size() - 3);
  const auto t = text.find('T');
  if (t == std::string::npos) return std::nullopt;
  std::replace(text.begin() + static_cast<std::ptrdiff_t>(t), text.end(), '-', ':');
  const auto time = parse_rfc3339(text);
  return time ? std::optional(time.value()) : std::nullopt;
}

}  // namespace

BackupKeeper::BackupKeeper(Database& database, const Clock& clock, Options options)
    : database_(database), clock_(clock), options_(std::move(options)) {}

std::vector<Backup> BackupKeeper::list() const {
  std::vector<Backup> out;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(options_.dir, error)) {
    const std::string name = entry.path().filename().string();
    const auto made = time_of(name);
    if (!made) continue;
    Backup backup{name, *made, entry.file_size(error), {}};
    std::ifstream(entry.path().string() + ".sha256") >> backup.sha256_hex;
    out.push_back(std::move(backup));
  }
  std::ranges::sort(out, std::ranges::greater{}, &Backup::made);
  return out;
}

Result<Backup> BackupKeeper::make() {
  const std::unique_lock lock(making_, std::try_to_lock);
  if (!lock) return make_error(Errc::conflict, "a backup is being made");
  std::error_code error;
  fs::create_directories(options_.dir, error);
  if (error) return make_error(Errc::storage_unavailable, options_.dir.string() + ": " + error.message());
  const auto health = database_.health();
  const auto space = fs::space(options_.dir, error);
  const std::uint64_t needed = health.db_bytes + health.wal_bytes + (500ULL << 20);
  if (!error && space.available < needed)
    return make_error(Errc::storage_full,
                      "no backup: it would leave less than 500 MiB free in " + options_.dir.string());
  const UtcTime now = clock_.now();
  const std::string name = name_of(now);
  BOOST_OUTCOME_TRY(const auto report, database_.backup(options_.dir / name));
  const auto all = list();
  for (std::size_t i = std::max<std::size_t>(options_.keep, 1); i < all.size(); ++i) {
    fs::remove(options_.dir / all[i].name, error);
    fs::remove(options_.dir / (all[i].name + ".sha256"), error);
  }
  return Backup{name, now, report.bytes, report.sha256_hex};
}

bool BackupKeeper::due(std::uint64_t flights_ended) {
  if (!options_.scheduled) return false;
  const std::scoped_lock lock(due_mutex_);
  const UtcTime now = clock_.now();
  if (looked_first_.ns == 0) looked_first_ = now;
  if (now < not_before_) return false;
  // Without any, the day counts from the start: a fresh installation has nothing to lose yet.
  const auto all = list();
  const UtcTime last = all.empty() ? looked_first_ : all.front().made;
  const bool old = now.ns - last.ns >= static_cast<std::int64_t>(options_.every_h) * 3600 * 1'000'000'000;
  if (!old && flights_ended == flights_saved_) {
    not_before_ = {now.ns + k_look_ns};
    return false;
  }
  flights_saved_ = flights_ended;
  not_before_ = {now.ns + k_pause_ns};
  return true;
}

}  // namespace anchord::server
