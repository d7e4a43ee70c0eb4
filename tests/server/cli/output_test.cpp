// What a command prints has arrived, or the command has failed: the real binary, before a disk that is full.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/paths.hpp"

namespace anchord::cli::output_test {
namespace {

namespace fs = std::filesystem;

struct Answer {
  int exit_code{};
  std::string err;
};
Answer run(const std::string& words) {
  const auto errors = fs::path(::testing::TempDir()) / ("anchord output " + std::to_string(::getpid()));
  const int status = std::system(
      ("'" + std::string(ANCHORD_BINARY) + "' " + words + " 2>'" + errors.string() + "'").c_str());
  std::ifstream in(errors, std::ios::binary);
  Answer answer{WEXITSTATUS(status), {std::istreambuf_iterator<char>(in), {}}};
  fs::remove(errors);
  return answer;
}

TEST(Output, ThatCannotBeWrittenFailsTheCommandWithTheReason) {
  for (const char* command : {"version", "man", "completion bash", "config show"}) {
    EXPECT_EQ(run(std::string(command) + " >/dev/null").exit_code, 0) << command;
    const auto full = run(std::string(command) + " >/dev/full");
    EXPECT_EQ(full.exit_code, 1) << command;
    EXPECT_THAT(full.err, ::testing::HasSubstr("anchord: cannot write the output")) << command;
  }
}

TEST(Output, ThatNobodyReadsToTheEndIsNoComplaint) { EXPECT_EQ(run("man | head -1 >/dev/null").err, ""); }

}  // namespace
}  // namespace anchord::cli::output_test
