#include "server/runtime/backup_keeper.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <tuple>

#include "server/storage/cir_copies.hpp"
#include "server/storage/sqlite_database.hpp"

namespace anchord::server {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view k_prefix = "anchord-", k_suffix = "Z.db";
constexpr std::size_t k_digits = 6;
constexpr std::int64_t k_hour_ns = 3600LL * 1'000'000'000;
// At most one in ten minutes, failed ones and days of many short flights included.
constexpr std::int64_t k_pause_ns = 600'000'000'000, k_look_ns = 2'000'000'000;
// What was read whole and found good is believed for a day while its size and time stay.
constexpr std::int64_t k_believed_ns = 24 * k_hour_ns;

/// anchord-000012-2026-11-21T08-30-00.123456Z.db: no colons, which some file systems refuse.
std::string name_of(std::uint64_t sequence, UtcTime time) {
  std::string number = std::to_string(sequence);
  if (number.size() < k_digits) number.insert(0, k_digits - number.size(), '0');
  std::string text = to_rfc3339(time);
  std::ranges::replace(text, ':', '-');
  return std::string(k_prefix) + number + '-' + text + ".db";
}

void note_cirs(Backup& backup, CirCopies cirs) {
  backup.cir_files = cirs.files;
  backup.cir_bytes = cirs.bytes;
  backup.cir_missing = std::move(cirs.missing);
}

/// Number and time of a name of ours; older ones have no number.
std::optional<std::pair<std::uint64_t, UtcTime>> read_name(const std::string& name) {
  if (!name.starts_with(k_prefix) || !name.ends_with(k_suffix)) return std::nullopt;
  std::string text = name.substr(k_prefix.size(), name.size() - k_prefix.size() - 3);
  std::uint64_t sequence = 0;
  if (const auto dash = text.find('-'); dash != std::string::npos && dash >= k_digits) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + dash, sequence);
    if (error != std::errc{} || end != text.data() + dash) return std::nullopt;
    text.erase(0, dash + 1);
  }
  const auto t = text.find('T');
  if (t == std::string::npos) return std::nullopt;
  std::replace(text.begin() + static_cast<std::ptrdiff_t>(t), text.end(), '-', ':');
  const auto time = parse_rfc3339(text);
  if (!time) return std::nullopt;
  return std::pair(sequence, time.value());
}

}  // namespace

BackupKeeper::BackupKeeper(Database& database, const Clock& clock, Options options)
    : database_(database), clock_(clock), options_(std::move(options)) {
  const auto all = list();
  if (all.empty()) return;
  auto state = state_.lock();
  state->newest = all.front().made;
}

SteadyTime BackupKeeper::steady_now() const { return options_.steady->now(); }

std::vector<Backup> BackupKeeper::list() const {
  std::vector<Backup> out;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(options_.dir, error)) {
    const std::string name = entry.path().filename().string();
    const auto made = read_name(name);
    if (!made) continue;
    Backup backup{name, made->first, made->second, entry.file_size(error), {}, {}};
    std::ifstream(entry.path().string() + ".sha256") >> backup.sha256_hex;
    note_cirs(backup, listed_backup_cirs(entry.path()));
    {
      const auto checked = checked_.lock();
      if (const auto at = checked->find(name); at != checked->end()) backup.good = at->second.good;
    }
    out.push_back(std::move(backup));
  }
  std::ranges::sort(out, std::ranges::greater{},
                    [](const Backup& b) { return std::tuple(b.sequence, b.made); });
  return out;
}

void BackupKeeper::note_checked(const std::string& name, bool good) {
  std::error_code error;
  const auto file = options_.dir / name;
  const Checked found{fs::file_size(file, error), fs::last_write_time(file, error), steady_now(), good};
  auto checked = checked_.lock();
  checked->insert_or_assign(name, found);
}

/// Its digest stands beside it and is right, and integrity_check finds nothing. Reads all of it, once a day.
bool BackupKeeper::whole(const Backup& backup) {
  std::error_code error;
  const auto file = options_.dir / backup.name;
  const auto bytes = fs::file_size(file, error);
  const auto written = fs::last_write_time(file, error);
  {
    const auto checked = checked_.lock();
    const auto at = checked->find(backup.name);
    if (at != checked->end() && at->second.bytes == bytes && at->second.written == written &&
        steady_now().ns - at->second.at.ns < k_believed_ns)
      return at->second.good;
  }
  const bool good = !backup.sha256_hex.empty() && check_backup(file).has_value();
  note_checked(backup.name, good);
  return good;
}

/// What is older than the newest so many whole ones; while there are fewer, nothing goes.
void BackupKeeper::drop_old() {
  const std::size_t keep = std::max(options_.keep, k_fewest);
  const auto all = list();
  if (all.size() <= keep) return;
  std::size_t good = 0;
  std::error_code error;
  for (const auto& backup : all) {
    if (good < keep) {
      if (whole(backup)) ++good;
      continue;
    }
    fs::remove(options_.dir / backup.name, error);
    fs::remove(options_.dir / (backup.name + ".sha256"), error);
    auto checked = checked_.lock();
    checked->erase(backup.name);
  }
  sql::drop_unneeded_copies(options_.dir);
}

Result<Backup> BackupKeeper::make(const std::function<bool()>& go_on) {
  const std::unique_lock lock(making_, std::try_to_lock);
  if (!lock) return make_error(Errc::conflict, "a backup is already being made");
  auto made = copy_now(go_on);
  auto state = state_.lock();
  if (made) {
    state->newest = made.value().made;
    state->failure.clear();
  } else if (made.error().code != Errc::canceled) {
    state->failure = made.error().message;
  }
  return made;
}

Result<Backup> BackupKeeper::copy_now(const std::function<bool()>& go_on) {
  std::error_code error;
  fs::create_directories(options_.dir, error);
  if (error) return make_error(Errc::storage_unavailable, options_.dir.string() + ": " + error.message());
  const auto health = database_.health();
  const auto space = fs::space(options_.dir, error);
  const std::uint64_t needed = health.db_bytes + health.wal_bytes + (500ULL << 20);
  if (!error && space.available < needed)
    return make_error(Errc::storage_full, "no backup was made: it would leave less than 500 MiB free in " +
                                              options_.dir.string());
  const auto before = list();
  const UtcTime now = clock_.now();
  const std::uint64_t sequence = (before.empty() ? 0 : before.front().sequence) + 1;
  const std::string name = name_of(sequence, now);
  BOOST_OUTCOME_TRY(auto report, database_.backup(options_.dir / name, go_on));
  note_checked(name, true);  // backup() checked what it wrote
  {
    auto due = due_.lock();
    due->newest = steady_now();
  }
  drop_old();
  Backup made{name, sequence, now, report.bytes, report.sha256_hex, true};
  note_cirs(made, std::move(report.cirs));
  return made;
}

/// When the newest backup was made. Without any, the day counts from the start: a fresh installation has
/// nothing to lose yet. The age of one of an earlier start is the system clock's word; where it cannot be
/// right, it is time for a new one.
SteadyTime BackupKeeper::first_look(SteadyTime now) const {
  const std::int64_t every_ns = static_cast<std::int64_t>(options_.every_h) * k_hour_ns;
  const auto all = list();
  const std::int64_t age_ns = all.empty() ? 0 : clock_.now().ns - all.front().made.ns;
  return later(now, -(age_ns < 0 ? every_ns : std::min(age_ns, every_ns)));
}

bool BackupKeeper::due(std::uint64_t flights_ended) {
  if (!options_.scheduled) return false;
  const SteadyTime now = steady_now();
  const std::int64_t every_ns = static_cast<std::int64_t>(options_.every_h) * k_hour_ns;
  auto due = due_.lock();
  if (!due->newest) {
    const SteadyTime found = due.unlocked([&] { return first_look(now); });
    due->newest = due->newest.value_or(found);  // one may have been made meanwhile
    due->not_before = now;
  }
  if (now < due->not_before) return false;
  const bool old = now.ns - due->newest.value_or(now).ns >= every_ns;
  if (!old && flights_ended == due->flights_saved) {
    due->not_before = later(now, k_look_ns);
    return false;
  }
  due->flights_saved = flights_ended;
  due->not_before = later(now, k_pause_ns);
  return true;
}

}  // namespace anchord::server
