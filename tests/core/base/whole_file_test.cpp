#include "core/base/whole_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <fstream>
#include <iterator>

#include "tests/scratch_dir.hpp"

namespace anchord::whole_file_test {
namespace {

namespace fs = std::filesystem;

struct WholeFiles : testing::Test {
  ScratchDir scratch;  // tests run side by side, each in a folder of its own
  fs::path folder = scratch.path();
  static std::string read(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }
};

/// As a disk that is full after so many bytes.
class Full {
 public:
  explicit Full(rlim_t bytes) : before_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &limit_);
    const rlimit small{bytes, limit_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~Full() {
    setrlimit(RLIMIT_FSIZE, &limit_);
    std::signal(SIGXFSZ, before_);
  }
  Full(const Full&) = delete;
  Full& operator=(const Full&) = delete;

 private:
  void (*before_)(int);
  rlimit limit_{};
};

TEST_F(WholeFiles, HaveTheNewTextAndTheRightsThatTheyHad) {
  const auto file = folder / "kit.json";
  ASSERT_TRUE(write_whole(file, "first"));
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  ASSERT_TRUE(write_whole(file, "second"));
  EXPECT_EQ(read(file), "second");
  EXPECT_EQ(fs::status(file).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_EQ(files(), 1u);
}

TEST_F(WholeFiles, AreAsBeforeWhereTheDiskIsFullAndLeaveNothingHalf) {
  const auto file = folder / "kit.json";
  ASSERT_TRUE(write_whole(file, "the profile of flights long ago"));
  {
    const Full disk(4096);
    const auto written = write_whole(file, std::string(20'000, 'x'));
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().code, Errc::storage_unavailable);
    EXPECT_EQ(written.error().message, file.string() + ": cannot be written: File too large");
    EXPECT_FALSE(write_whole(folder / "new.json", std::string(20'000, 'x')));
  }
  EXPECT_EQ(read(file), "the profile of flights long ago");
  EXPECT_EQ(files(), 1u);
}

TEST_F(WholeFiles, AreNotThereWhereNobodyPutThemInPlace) {
  { WholeFile(folder / "track.csv").out() << "t_s\n"; }
  EXPECT_EQ(files(), 0u);
}

TEST_F(WholeFiles, AreWrittenBehindALinkWhichStaysOne) {
  ASSERT_TRUE(write_whole(folder / "kit-2026.json", "old"));
  fs::create_symlink("kit-2026.json", folder / "kit.json");
  ASSERT_TRUE(write_whole(folder / "kit.json", "new"));
  EXPECT_TRUE(fs::is_symlink(folder / "kit.json"));
  EXPECT_EQ(read(folder / "kit-2026.json"), "new");
}

TEST_F(WholeFiles, GoToADeviceAsItIs) {
  EXPECT_TRUE(write_whole("/dev/null", "text"));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  const auto full = write_whole("/dev/full", "text");
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().message, "/dev/full: cannot be written: No space left on device");
}

TEST_F(WholeFiles, InAFolderThatIsNotThereSaySo) {
  const auto written = write_whole(folder / "none" / "kit.json", "text");
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().message,
            (folder / "none" / "kit.json").string() + ": cannot be written: No such file or directory");
}

}  // namespace
}  // namespace anchord::whole_file_test
