#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <functional>
#include <string>

/// A process of our own that can be killed. The body's answer is its exit code; what it writes to `out` can
/// be read.
class Child {
 public:
  explicit Child(const std::function<int(int out)>& body) {
    int ends[2] = {-1, -1};
    if (::pipe(ends) != 0) return;
    pid_ = ::fork();
    if (pid_ == 0) {
      ::close(ends[0]);
      ::_exit(body(ends[1]));
    }
    ::close(ends[1]);
    out_ = ends[0];
  }
  ~Child() {
    kill_now();
    if (out_ >= 0) ::close(out_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Exit code, or -1 when a signal ended it.
  int wait() {
    int status = 0;
    if (pid_ <= 0 || ::waitpid(pid_, &status, 0) != pid_) return -1;
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  void kill_now() {
    if (pid_ > 0) ::kill(pid_, SIGKILL);
    wait();
  }
  /// One byte from the child; false at its end.
  bool read_byte() {
    char byte = 0;
    return ::read(out_, &byte, 1) == 1;
  }

 private:
  pid_t pid_{-1};
  int out_{-1};
};
