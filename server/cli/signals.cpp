#include "server/cli/signals.hpp"

#include <pthread.h>
#include <signal.h>

#include <algorithm>

namespace anchord::cli {
namespace {

sigset_t set_of(std::initializer_list<int> wanted) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int one : wanted) sigaddset(&signals, one);
  return signals;
}

}  // namespace

void block_signals(std::initializer_list<int> wanted) {
  const sigset_t signals = set_of(wanted);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

int wait_for_signal(std::initializer_list<int> wanted) {
  const sigset_t signals = set_of(wanted);
  int received = 0;
  sigwait(&signals, &received);
  return received;
}

bool signal_waits(std::initializer_list<int> wanted) {
  sigset_t pending;
  sigpending(&pending);
  return std::ranges::any_of(wanted, [&](int one) { return sigismember(&pending, one) == 1; });
}

}  // namespace anchord::cli
