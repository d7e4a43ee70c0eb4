#include "drivers/record/recorder.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <utility>
#include <vector>

#include "core/base/file_place.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"

namespace anchord::record {
namespace fs = std::filesystem;
namespace {

constexpr std::int64_t k_retry_ns = 10'000'000'000;

/// "20261121T064100Z": sorts by time, safe in any file system.
std::string stem_of(UtcTime now) {
  std::string out;
  for (const char c : to_rfc3339(now).substr(0, 19)) {
    if (c != '-' && c != ':') out += c;
  }
  return out + "Z";
}

std::string part_name(const std::string& stem, int part) {
  char text[32];
  std::snprintf(text, sizeof text, "-%04d.anrec", part);
  return stem + text;
}

bool write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const auto n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

/// What the syncing thread shares with the writing one.
struct Parts {
  int fd{-1};                 ///< being written
  std::vector<int> finished;  ///< written to their end: the syncing thread syncs and closes them
  bool new_name{false};       ///< a part was begun, and its folder not synced since
  fs::path file;              ///< of fd
  FilePlace place{{}};        ///< of that file
  std::string failure;        ///< of the last write
  std::string unsynced;       ///< of the last sync: a disk that was pulled takes writes until then
  bool stopping{false};
};

/// Descriptors of its own: the writer may turn to the next part meanwhile.
struct ToSync {
  std::vector<int> fds;
  bool folder{false};
};

ToSync take_finished(Parts& parts) {
  ToSync out;
  out.fds.swap(parts.finished);
  out.folder = std::exchange(parts.new_name, false);
  return out;
}

}  // namespace

struct Recorder::State {
  fs::path folder;
  std::string stem;
  RecorderOptions options;

  // Of the calling thread.
  int part{0}, fd{-1};
  std::uint64_t in_part{0};
  std::int64_t retry_at_ns{0};
  std::map<std::uint16_t, std::string> devices;  ///< "added" payloads, for the next part
  std::string mission, scratch;

  Locked<Parts> parts;
  std::condition_variable wake;
  std::atomic<std::uint64_t> written{0}, lost{0};
  std::atomic<bool> scarce{false};       ///< the disk has less than keep_free_bytes
  std::atomic<bool> taken_away{false};   ///< the part that is written: what follows goes to the next one
  std::map<fs::path, bool> of_a_flight;  ///< of the syncing thread: finished parts it has read
  Thread syncer;

  Result<void> next_part(const link::Arrival& at);
  void remember(const Event& event);
  bool write(std::string_view bytes);
  void fail(std::int64_t now_ns, const std::string& why);
  int sync(const ToSync& what) const;
  void make_room(const fs::path& in_use);
  void sync_loop();
};

Result<void> Recorder::State::next_part(const link::Arrival& at) {
  int opened = -1;
  fs::path path;
  std::error_code ignored;
  fs::create_directories(folder, ignored);  // it may have been taken away since; the open says what is wrong
  do {
    path = folder / part_name(stem, ++part);
    opened = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0600);
  } while (opened < 0 && errno == EEXIST && part < 9999);
  if (opened < 0) {
    return make_error(errno == ENOSPC ? Errc::storage_full : Errc::storage_unavailable,
                      path.string() + ": " + std::strerror(errno));
  }
  {
    auto now = parts.lock();
    if (now->fd >= 0) now->finished.push_back(now->fd);
    now->fd = fd = opened;
    now->new_name = true;
    now->file = path;
    now->place = FilePlace(path);
    taken_away = false;  // under the lock, as the syncing thread sets it: of this part, not of the one before
    now->failure.clear();
  }
  wake.notify_all();
  std::string head(k_magic);
  for (const auto& [slot, settings] : devices) append_record(head, {EventKind::added, slot, at, settings});
  if (!mission.empty()) append_record(head, {EventKind::mission, 0, at, mission});
  in_part = 0;
  if (!write(head)) return make_error(Errc::storage_full, path.string() + ": " + std::strerror(errno));
  return boost::outcome_v2::success();
}

bool Recorder::State::write(std::string_view bytes) {
  if (!write_all(fd, bytes)) return false;
  in_part += bytes.size();
  written += bytes.size();
  return true;
}

void Recorder::State::remember(const Event& event) {
  switch (event.kind) {
    case EventKind::added:
      devices[event.slot] = std::string(event.payload);
      break;
    case EventKind::removed:
      devices.erase(event.slot);
      break;
    case EventKind::mission:
      mission = std::string(event.payload);
      break;
    case EventKind::opened:
    case EventKind::bytes:
    case EventKind::tick:
    case EventKind::closed:
    case EventKind::command:
      break;
  }
}

void Recorder::State::fail(std::int64_t now_ns, const std::string& why) {
  retry_at_ns = now_ns + k_retry_ns;
  auto now = parts.lock();
  now->failure = now->file.string() + ": " + why;
}

/// errno of what failed first, or 0.
int Recorder::State::sync(const ToSync& what) const {
  int failed = 0;
  for (const int one : what.fds) {
    if (::fdatasync(one) != 0 && failed == 0) failed = errno;
    ::close(one);
  }
  if (!what.folder) return failed;
  const int names = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (names < 0) return failed == 0 ? errno : failed;
  (void)::fsync(names);  // not every file system can
  ::close(names);
  return failed;
}

/// The oldest first, as many as make_room_bytes want; never the part that is written, nor one of a flight.
void Recorder::State::make_room(const fs::path& in_use) {
  std::error_code error;
  std::vector<fs::path> old;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    if (it->path().extension() == ".anrec" && it->path().filename() < in_use.filename())
      old.push_back(it->path());
  std::sort(old.begin(), old.end());
  for (const auto& file : old) {
    const auto known = of_a_flight.find(file);
    if (known == of_a_flight.end() ? (of_a_flight[file] = may_hold_a_flight(file)) : known->second) continue;
    if (!fs::remove(file, error)) continue;
    of_a_flight.erase(file);
    if (options.removed) options.removed(file);
    const auto space = fs::space(folder, error);
    if (error || space.available >= options.make_room_bytes) return;
  }
}

void Recorder::State::sync_loop() {
  const auto every = std::chrono::milliseconds(options.sync_every_ms);
  for (std::uint64_t synced = 0;;) {
    ToSync due;
    fs::path file;
    FilePlace place{{}};
    {
      auto now = parts.lock();
      now.wait_for(wake, every, [](const Parts& p) { return p.stopping || !p.finished.empty(); });
      if (now->stopping) return;
      due = take_finished(*now);
      file = now->file;
      place = now->place;
      if (const auto so_far = written.load(); now->fd >= 0 && so_far != synced) {
        if (const int copy = ::dup(now->fd); copy >= 0) {
          due.fds.push_back(copy);
          synced = so_far;
        }
      }
    }
    const int failed = sync(due);
    const bool holds = place.holds();
    std::error_code unknown;
    auto space = fs::space(folder, unknown);
    if (!unknown && space.available < options.make_room_bytes) {
      (void)guarded("room for recordings", [&] { make_room(file); });
      space = fs::space(folder, unknown);
    }
    scarce = !unknown && space.available < options.keep_free_bytes;
    if (due.fds.empty() && failed == 0 && holds) continue;
    auto now = parts.lock();
    now->unsynced =
        failed == 0 ? "" : now->file.string() + ": cannot be synced to the disk: " + std::strerror(failed);
    if (holds || now->file != file) continue;
    taken_away = true;
    now->unsynced =
        file.string() + ": was removed, renamed or replaced; what follows is written to another file";
  }
}

Recorder::Recorder(std::unique_ptr<State> state) : state_(std::move(state)) {
  state_->syncer = Thread("anchord-record", [state_now = state_.get()] { state_now->sync_loop(); });
}

Recorder::~Recorder() {
  {
    auto parts = state_->parts.lock();
    parts->stopping = true;
  }
  state_->wake.notify_all();
  state_->syncer.join();
  ToSync rest;
  {
    auto parts = state_->parts.lock();
    if (parts->fd >= 0) parts->finished.push_back(parts->fd);
    rest = take_finished(*parts);
  }
  (void)state_->sync(rest);
}

Result<std::unique_ptr<Recorder>> Recorder::open(const fs::path& folder, UtcTime now,
                                                 const RecorderOptions& options) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error) fs::permissions(folder, fs::perms::owner_all, error);
  if (error) return make_error(Errc::storage_unavailable, folder.string() + ": " + error.message());
  auto state = std::make_unique<State>();
  state->folder = folder;
  state->stem = stem_of(now);
  state->options = options;
  BOOST_OUTCOME_TRY(state->next_part({now, 0}));
  return std::unique_ptr<Recorder>(new Recorder(std::move(state)));
}

void Recorder::take(const Event& event) {
  auto& s = *state_;
  s.remember(event);
  const bool broken = s.retry_at_ns != 0;
  if (broken && event.at.steady_ns < s.retry_at_ns) {
    ++s.lost;
    return;
  }
  if (s.scarce) {
    ++s.lost;
    return s.fail(event.at.steady_ns, "less than " + std::to_string(s.options.keep_free_bytes >> 20) +
                                          " MiB free on the disk, kept for measurements: free some space");
  }
  // After a failure the old part may end in half a record: what comes goes to a new one.
  // So does what comes after a part was removed, renamed or replaced: nobody would find it there.
  if (broken || s.taken_away || s.in_part >= s.options.rotate_bytes) {
    if (const auto next = s.next_part(event.at); !next) {
      ++s.lost;
      return s.fail(event.at.steady_ns, std::strerror(errno));
    }
    s.retry_at_ns = 0;
    const bool told =
        event.kind == EventKind::added || (event.kind == EventKind::mission && !event.payload.empty());
    if (told) return;  // the head of the new part says it
  }
  s.scratch.clear();
  append_record(s.scratch, event);
  if (!s.write(s.scratch)) {
    ++s.lost;
    s.fail(event.at.steady_ns, std::strerror(errno));
  }
}

std::string Recorder::failed() const {
  const auto parts = state_->parts.lock();
  return parts->failure.empty() ? parts->unsynced : parts->failure;
}
std::uint64_t Recorder::bytes_written() const { return state_->written; }
std::uint64_t Recorder::events_lost() const { return state_->lost; }
fs::path Recorder::file() const {
  const auto parts = state_->parts.lock();
  return parts->file;
}

bool may_hold_a_flight(const fs::path& part) {
  std::ifstream in(part, std::ios::binary);
  std::string magic(k_magic.size(), '\0');
  if (!in.read(magic.data(), static_cast<std::streamsize>(magic.size())) || magic != k_magic) return true;
  std::array<unsigned char, k_record_head + 1> head{};
  while (in.read(reinterpret_cast<char*>(head.data()), head.size())) {
    std::uint32_t length = 0;
    for (std::size_t i = 4; i-- > 0;) length = length << 8 | head[i];
    if (length < k_body_head || length > k_body_head + k_max_payload) return true;
    const bool names_a_mission = length > k_body_head;
    if (head[k_record_head] == static_cast<unsigned char>(EventKind::mission) && names_a_mission) return true;
    in.ignore(length - 1);
  }
  return false;
}

Result<std::vector<fs::path>> parts_of(const fs::path& file) {
  const auto name = file.filename().string();
  const auto dash = name.rfind('-');
  if (!name.ends_with(".anrec") || dash == std::string::npos) {
    return make_error(Errc::invalid_argument, file.string() + ": recordings are called <start>-NNNN.anrec");
  }
  const auto stem = name.substr(0, dash);
  std::vector<fs::path> out{file};
  std::error_code error;
  const auto folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const auto other = it->path().filename().string();
    if (other > name && other.ends_with(".anrec") && other.substr(0, other.rfind('-')) == stem) {
      out.push_back(it->path());
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace anchord::record
