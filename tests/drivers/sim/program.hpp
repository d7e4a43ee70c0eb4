#pragma once

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <string>
#include <vector>

namespace anchord::sim::test {

/// Somebody else's program, silent, until the end of the scope.
class Program {
 public:
  explicit Program(std::vector<std::string> words) : pid_(::fork()) {
    if (pid_ != 0) return;
    if (::freopen("/dev/null", "w", stderr) == nullptr || ::freopen("/dev/null", "w", stdout) == nullptr ||
        ::freopen("/dev/null", "r", stdin) == nullptr)
      ::_exit(126);
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  ~Program() { end(SIGTERM); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  /// Waits until it has gone.
  void end(int signal) {
    if (pid_ < 0) return;
    ::kill(pid_, signal);
    for (int i = 0; i < 500 && ::waitpid(pid_, nullptr, WNOHANG) == 0; ++i) {
      if (i == 499) ::kill(pid_, SIGKILL);  // five seconds are enough for anybody
      ::usleep(10'000);
    }
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_;
};

}  // namespace anchord::sim::test
