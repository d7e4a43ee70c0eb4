// docs/architecture.md lists every thread there is, and a running server has those and no others.
#include <algorithm>
#include <chrono>
#include <iterator>
#include <regex>
#include <set>

#include "tests/paths.hpp"
#include "tests/server/app/app_fixture.hpp"

namespace anchord::test::threads_test {
namespace {

namespace fs = std::filesystem;

/// Names in the table; first: of all, second: of those that are there only while they have something to do.
std::pair<std::set<std::string>, std::set<std::string>> documented() {
  std::pair<std::set<std::string>, std::set<std::string>> out;
  std::ifstream page(ANCHORD_TEST_DATA "/../../docs/architecture.md");
  const std::regex row(R"(\| `(anchord-[a-z]+)` \| (while )?.*)");
  std::smatch found;
  for (std::string line; std::getline(page, line);) {
    if (!std::regex_match(line, found, row)) continue;
    out.first.insert(found[1]);
    if (found[2].matched) out.second.insert(found[1]);
  }
  return out;
}

std::set<std::string> running() {
  std::set<std::string> out;
  for (const auto& task : fs::directory_iterator("/proc/self/task")) {
    std::string name;
    std::ifstream(task.path() / "comm") >> name;
    if (name.starts_with("anchord-")) out.insert(name);
  }
  return out;
}

TEST(Threads, OfARunningServerAreThoseThatTheArchitectureLists) {
  AppFixture server(Settings{{"drone.address", "tcp://127.0.0.1:9"}, {"devices", "gnss=tcp://127.0.0.1:9"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto [listed, at_times] = documented();
  ASSERT_GT(listed.size(), 10u);
  std::set<std::string> expected;
  std::ranges::set_difference(listed, at_times, std::inserter(expected, expected.end()));
  // A new thread bears the name of the one that made it until it has its own.
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::set<std::string> always;
  do {
    always.clear();
    std::ranges::set_difference(running(), at_times, std::inserter(always, always.end()));
  } while (always != expected && std::chrono::steady_clock::now() < end);
  EXPECT_EQ(always, expected);
}

}  // namespace
}  // namespace anchord::test::threads_test
