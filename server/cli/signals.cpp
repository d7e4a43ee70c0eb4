#include "server/cli/signals.hpp"

#include <pthread.h>
#include <signal.h>

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

}  // namespace anchord::cli
