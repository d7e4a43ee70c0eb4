#include "server/runtime/chromium_pdf.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "server/runtime/spawn_attributes.hpp"

namespace anchord::server {
namespace {

constexpr std::array k_programs{"/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"};
constexpr std::chrono::seconds k_patience{60};
constexpr std::chrono::milliseconds k_look{20};

std::string installed() {
  for (const char* program : k_programs)
    if (::access(program, X_OK) == 0) return program;
  return {};
}

/// In a process group of its own, so that all of its processes end with it; -1 where it does not start.
pid_t start(std::vector<std::string> words) {
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    posix_spawn_file_actions_addopen(&actions, fd, "/dev/null", fd == STDIN_FILENO ? O_RDONLY : O_WRONLY, 0);
  posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  const SpawnAttributes attributes(true);
  std::string path = "PATH=/usr/bin:/bin";
  char* environment[] = {path.data(), nullptr};
  pid_t pid = -1;
  if (posix_spawn(&pid, arguments[0], &actions, attributes.get(), arguments.data(), environment) != 0)
    pid = -1;
  posix_spawn_file_actions_destroy(&actions);
  return pid;
}

/// Whether it ended by itself, well.
bool ended_well(pid_t pid) {
  const auto until = std::chrono::steady_clock::now() + k_patience;
  int status = 0;
  while (::waitpid(pid, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > until) {
      ::kill(-pid, SIGKILL);
      ::waitpid(pid, &status, 0);
      return false;
    }
    std::this_thread::sleep_for(k_look);
  }
  ::kill(-pid, SIGKILL);  // helpers of it that have not noticed yet
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

Result<void> print_with_chromium(const std::filesystem::path& html, const std::filesystem::path& pdf) {
  const std::string program = installed();
  if (program.empty())
    return make_error(Errc::unsupported,
                      "the server prints it with Chromium, which is not installed (Debian: chromium); every "
                      "browser prints report.html");
  const auto profile = pdf.parent_path() / "chromium";
  std::vector<std::string> words{program,
                                 "--headless",
                                 "--disable-gpu",
                                 "--disable-dev-shm-usage",
                                 "--disable-background-networking",
                                 "--host-resolver-rules=MAP * ~NOTFOUND",
                                 "--user-data-dir=" + profile.string(),
                                 "--no-pdf-header-footer",
                                 "--print-to-pdf=" + pdf.string()};
  // Chromium's own sandbox does not start for root; the page is ours, and has no script.
  if (::geteuid() == 0) words.emplace_back("--no-sandbox");
  words.push_back("file://" + html.string());
  const pid_t pid = start(std::move(words));
  const bool well = pid > 0 && ended_well(pid);
  std::error_code gone;
  std::filesystem::remove_all(profile, gone);
  if (well && std::filesystem::file_size(pdf, gone) > 0 && !gone) return boost::outcome_v2::success();
  return make_error(Errc::internal,
                    program + " of the server did not print it; every browser prints report.html");
}

}  // namespace anchord::server
