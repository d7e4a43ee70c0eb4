#include "drivers/record/recorder.hpp"

#include <dlfcn.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <fstream>
#include <iterator>
#include <map>
#include <set>

#include "core/base/locked.hpp"

namespace {

/// Size of each file (or 0: a folder) when it was last synced, by inode.
using Sizes = std::map<ino_t, off_t>;
anchord::Locked<Sizes>& synced_sizes() {
  static anchord::Locked<Sizes> all;
  return all;
}
std::condition_variable synced_one;
std::atomic<bool> pulled{false};  ///< the disk: it takes what is written and keeps nothing

int note_sync(int fd, const char* name) {
  if (pulled) return errno = EIO, -1;
  struct stat info {};
  if (::fstat(fd, &info) == 0) {
    auto sizes = synced_sizes().lock();
    (*sizes)[info.st_ino] = S_ISDIR(info.st_mode) ? 0 : info.st_size;
    synced_one.notify_all();
  }
  return reinterpret_cast<int (*)(int)>(::dlsym(RTLD_NEXT, name))(fd);
}

}  // namespace

// In front of libc's, which they call.
extern "C" int fdatasync(int fd) { return note_sync(fd, "fdatasync"); }
extern "C" int fsync(int fd) { return note_sync(fd, "fsync"); }

namespace anchord::record::recorder_test {
namespace {

namespace fs = std::filesystem;

struct Folder {
  Folder() { fs::remove_all(path); }
  ~Folder() { fs::remove_all(path); }
  fs::path path{fs::temp_directory_path() / ("anchord_rec_" + std::to_string(::getpid()) + "_" +
                                             testing::UnitTest::GetInstance()->current_test_info()->name())};
};

std::string slurp(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::string> payloads(const fs::path& first) {
  std::vector<std::string> out;
  const auto parts = parts_of(first).value();
  for (const auto& part : parts) {
    const auto text = slurp(part);
    EventReader reader(text);
    EXPECT_TRUE(reader.begin()) << part;
    while (const auto event = reader.next()) {
      if (event->kind == EventKind::bytes) out.emplace_back(event->payload);
    }
  }
  return out;
}

const UtcTime k_start{1'795'243'500'000'000'000};

TEST(Recorder, WritesForTheOwnerAloneAndNeverOverWhatIsThere) {
  const Folder folder;
  fs::path first;
  {
    const auto recorder = Recorder::open(folder.path, k_start).value();
    first = recorder->file();
    EXPECT_EQ(fs::status(first).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  }
  const auto second = Recorder::open(folder.path, k_start).value();
  EXPECT_NE(second->file(), first);
}

ino_t inode_of(const fs::path& path) {
  struct stat info {};
  EXPECT_EQ(::stat(path.c_str(), &info), 0) << path;
  return info.st_ino;
}

// A power cut takes at most the last second. What a part got after its last sync stayed in the page cache
// when the recorder turned to the next part, and the name of a new file in its folder: half a minute for the
// kernel.
TEST(Recorder, SyncsEachPartToItsEndAndItsName) {
  const Folder folder;
  RecorderOptions options;
  options.rotate_bytes = 1000;
  options.sync_every_ms = 3'600'000;  // not within this test
  const auto recorder = Recorder::open(folder.path, k_start, options).value();
  const auto first = recorder->file();
  for (int i = 0; recorder->file() == first; ++i)
    recorder->take({EventKind::bytes, 3, {UtcTime{i}, i}, "a chunk of bytes"});
  const auto size = static_cast<off_t>(fs::file_size(first));
  ASSERT_GE(size, 1000);
  const ino_t part = inode_of(first), names = inode_of(folder.path);
  auto sizes = synced_sizes().lock();
  EXPECT_TRUE(sizes.wait_for(synced_one, std::chrono::seconds(20), [&](const Sizes& s) {
    const auto at = s.find(part);
    return at != s.end() && at->second == size && s.contains(names);
  }));
}

// write() goes to memory: that the disk is gone is the sync's to tell.
TEST(Recorder, ADiskThatIsGoneIsToldAndForgottenWhenItIsBack) {
  const Folder folder;
  RecorderOptions options;
  options.sync_every_ms = 1;
  const auto recorder = Recorder::open(folder.path, k_start, options).value();
  auto until = [&, n = std::int64_t{0}](auto holds) mutable {
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
         !holds(recorder->failed()) && std::chrono::steady_clock::now() < end; ++n)
      recorder->take({EventKind::bytes, 3, {UtcTime{n}, n}, "a chunk of bytes"});
    return recorder->failed();
  };
  pulled = true;
  EXPECT_EQ(until([](const std::string& why) { return !why.empty(); }),
            recorder->file().string() + ": cannot be synced to the disk: Input/output error");
  pulled = false;
  EXPECT_EQ(until([](const std::string& why) { return why.empty(); }), "");
  EXPECT_EQ(recorder->events_lost(), 0U);
}

// A file that was removed takes what is written, and nobody finds it.
TEST(Recorder, BeginsANewPartWhenThatOfNowIsTakenAwayAlsoWithItsFolder) {
  const Folder folder;
  RecorderOptions options;
  options.sync_every_ms = 1;
  const auto recorder = Recorder::open(folder.path, k_start, options).value();
  std::int64_t n = 0;
  const auto record_until_it_moves_on_from = [&](const fs::path& part) {
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
         recorder->file() == part && std::chrono::steady_clock::now() < end; ++n)
      recorder->take({EventKind::bytes, 3, {UtcTime{n}, n}, "a chunk of bytes"});
    return recorder->file();
  };
  const auto first = recorder->file();
  fs::rename(first, first.string() + ".mine");
  const auto second = record_until_it_moves_on_from(first);
  EXPECT_NE(second, first);
  fs::remove_all(folder.path);
  const auto third = record_until_it_moves_on_from(second);
  EXPECT_NE(third, second);
  recorder->take({EventKind::bytes, 3, {UtcTime{n}, n}, "the last chunk"});
  EXPECT_NE(slurp(third).find("the last chunk"), std::string::npos);
  EXPECT_EQ(recorder->events_lost(), 0U);
}

// Raw bytes are ten times the rows that are made of them, and the first to give way.
TEST(Recorder, LeavesTheLastOfTheDiskToTheRows) {
  const Folder folder;
  RecorderOptions options;
  options.sync_every_ms = 1;
  options.keep_free_bytes = std::uint64_t{1} << 60;
  const auto recorder = Recorder::open(folder.path, k_start, options).value();
  std::int64_t n = 0;
  for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
       recorder->failed().empty() && std::chrono::steady_clock::now() < end; ++n)
    recorder->take({EventKind::bytes, 3, {UtcTime{n}, n}, "a chunk of bytes"});
  EXPECT_NE(recorder->failed().find("MiB free on the disk, kept for measurements"), std::string::npos);
  EXPECT_GT(recorder->events_lost(), 0U);
}

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> out;
  for (const auto& entry : fs::directory_iterator(folder)) out.insert(entry.path().filename().string());
  return out;
}

// Bytes of a device that never made sense filled the disk until no flight could start.
TEST(Recorder, OldPartsWithoutAFlightMakeRoomAndThoseOfFlightsStay) {
  const Folder folder;
  const auto record = [&](std::int64_t at_s, const std::vector<std::string>& missions) {
    const auto recorder =
        Recorder::open(folder.path, UtcTime{k_start.ns + at_s * 1'000'000'000}, {.make_room_bytes = 0})
            .value();
    recorder->take({EventKind::added, 3, {}, R"({"id":"a"})"});
    for (int i = 0; i < 20; ++i)
      recorder->take({EventKind::bytes, 3, {UtcTime{i}, i}, std::string(5000, 'x')});
    for (const auto& mission : missions) recorder->take({EventKind::mission, 0, {}, mission});
    return recorder->file();
  };
  const std::string mission = "0190f1f2-0000-7000-8000-000000000001";
  const auto idle = record(0, {}), flown = record(10, {mission, ""}), ended = record(20, {""}),
             torn = record(30, {}), spoilt = record(40, {});
  fs::resize_file(torn, fs::file_size(torn) - 7);
  {
    std::fstream file(spoilt, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(k_magic.size()));
    file.write("\xff\xff\xff\x7f", 4);
  }
  EXPECT_FALSE(may_hold_a_flight(idle));
  EXPECT_TRUE(may_hold_a_flight(flown));
  EXPECT_FALSE(may_hold_a_flight(ended));
  EXPECT_FALSE(may_hold_a_flight(torn));
  EXPECT_TRUE(may_hold_a_flight(spoilt)) << "what cannot be read may be a flight";

  RecorderOptions options;
  options.sync_every_ms = 1;
  options.keep_free_bytes = 0;
  options.make_room_bytes = std::uint64_t{1} << 60;  // this disk never has it
  Locked<std::vector<std::string>> removed;
  options.removed = [&](const fs::path& part) {
    auto all = removed.lock();
    all->push_back(part.filename().string());
  };
  fs::path own;
  {
    const auto recorder = Recorder::open(folder.path, UtcTime{k_start.ns + 50'000'000'000}, options).value();
    own = recorder->file();
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (removed.copy().size() < 3 && std::chrono::steady_clock::now() < end) ::usleep(1000);
    recorder->take({EventKind::bytes, 3, {}, "still recorded"});
    EXPECT_EQ(recorder->failed(), "");
  }
  EXPECT_EQ(removed.copy(), (std::vector<std::string>{idle.filename().string(), ended.filename().string(),
                                                      torn.filename().string()}))
      << "the oldest first";
  EXPECT_EQ(names_in(folder.path),
            (std::set<std::string>{flown.filename().string(), spoilt.filename().string(),
                                   own.filename().string()}));
}

TEST(Recorder, TheEndOfAMissionIsSaidThoughANewPartBeginsWithIt) {
  const Folder folder;
  fs::path first;
  {
    const auto recorder = Recorder::open(folder.path, k_start, {.rotate_bytes = 1000}).value();
    first = recorder->file();
    recorder->take({EventKind::mission, 0, {}, "0190f1f2-0000-7000-8000-000000000001"});
    recorder->take({EventKind::bytes, 3, {}, std::string(2000, 'x')});
    recorder->take({EventKind::mission, 0, {}, ""});
  }
  const auto parts = parts_of(first).value();
  ASSERT_EQ(parts.size(), 2U);
  const auto text = slurp(parts[1]);
  EventReader reader(text);
  ASSERT_TRUE(reader.begin());
  const auto said = reader.next();
  ASSERT_TRUE(said);
  EXPECT_EQ(said->kind, EventKind::mission);
  EXPECT_EQ(said->payload, "");
}

TEST(Recorder, TurnsToANewPartThatTellsTheDevicesAgain) {
  const Folder folder;
  RecorderOptions options;
  options.rotate_bytes = 1000;
  std::vector<std::string> expected;
  fs::path first;
  {
    const auto recorder = Recorder::open(folder.path, k_start, options).value();
    first = recorder->file();
    recorder->take({EventKind::added, 3, {}, R"({"id":"a"})"});
    recorder->take({EventKind::mission, 0, {}, "0190f1f2-0000-7000-8000-000000000001"});
    for (int i = 0; i < 100; ++i) {
      expected.push_back("chunk " + std::to_string(i));
      recorder->take({EventKind::bytes, 3, {UtcTime{i}, i}, expected.back()});
    }
  }
  EXPECT_EQ(payloads(first), expected);
  const auto parts = parts_of(first).value();
  ASSERT_GT(parts.size(), 3U);
  const auto text = slurp(parts[2]);
  EventReader reader(text);
  ASSERT_TRUE(reader.begin());
  const auto device = reader.next();
  ASSERT_TRUE(device);
  EXPECT_EQ(device->kind, EventKind::added);
  EXPECT_EQ(device->slot, 3);
  EXPECT_EQ(reader.next()->kind, EventKind::mission);
}

TEST(Recorder, AKilledProcessLosesNothingItHandedOver) {
  const Folder folder;
  for (int round = 0; round < 5; ++round) {
    int pipe_ends[2];
    ASSERT_EQ(::pipe(pipe_ends), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      auto recorder = Recorder::open(folder.path / std::to_string(round), k_start);
      if (!recorder) ::_exit(2);
      for (std::uint32_t i = 0;; ++i) {
        recorder.value()->take({EventKind::bytes, 1, {}, std::string(50 + i % 500, 'x')});
        if (::write(pipe_ends[1], &i, sizeof i) != sizeof i) ::_exit(3);
      }
    }
    ::close(pipe_ends[1]);
    std::uint32_t told = 0;
    while (told < 1000U + 777U * static_cast<unsigned>(round)) {
      ASSERT_EQ(::read(pipe_ends[0], &told, sizeof told), static_cast<ssize_t>(sizeof told));
    }
    ::kill(child, SIGKILL);
    while (::read(pipe_ends[0], &told, sizeof told) == static_cast<ssize_t>(sizeof told)) {
    }
    ::close(pipe_ends[0]);
    ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    const auto file = fs::directory_iterator(folder.path / std::to_string(round))->path();
    EXPECT_GE(payloads(file).size(), told + 1U);
  }
}

TEST(Recorder, AFullDiskIsToldAndTriedAgain) {
  const Folder folder;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // The limit on file sizes stands for the full disk.
    ::signal(SIGXFSZ, SIG_IGN);
    const auto recorder = Recorder::open(folder.path, k_start).value();
    rlimit limit{2000, RLIM_INFINITY};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    for (int i = 0; i < 100; ++i) recorder->take({EventKind::bytes, 1, {{}, i}, std::string(100, 'x')});
    const bool told = !recorder->failed().empty() && recorder->events_lost() > 80;
    limit.rlim_cur = RLIM_INFINITY;
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const auto lost = recorder->events_lost();
    recorder->take({EventKind::bytes, 1, {{}, 11'000'000'000}, "again"});
    const bool back = recorder->failed().empty() && recorder->events_lost() == lost;
    ::_exit(told && back ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  std::vector<fs::path> files(fs::directory_iterator(folder.path), {});
  ASSERT_EQ(files.size(), 2U);
  const auto all = payloads(std::min(files[0], files[1]));
  EXPECT_EQ(all.back(), "again");
}

}  // namespace
}  // namespace anchord::record::recorder_test
