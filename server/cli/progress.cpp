#include "server/cli/progress.hpp"

#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <utility>

namespace anchord::cli {
namespace {

volatile std::sig_atomic_t g_signal = 0;

void remember(int signal) { g_signal = signal; }

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

Progress::Progress(std::string what) : what_(std::move(what)), terminal_(::isatty(2) != 0) {}

Progress::~Progress() {
  if (terminal_ && shown_) std::fputc('\n', stderr);
}

void Progress::show(double fraction) {
  const double now = now_s();
  if (now < next_s_) return;
  // The first line of a file of logs comes late: most runs are over by then.
  if (!terminal_ && next_s_ == 0) {
    next_s_ = now + 10;
    return;
  }
  next_s_ = now + (terminal_ ? 0.2 : 10);
  std::fprintf(stderr, terminal_ ? "\r%s: %3.0f %%" : "%s: %3.0f %%\n", what_.c_str(), 100 * fraction);
  shown_ = true;
}

bool interrupted() {
  static const bool listening = [] {
    std::signal(SIGINT, remember);
    std::signal(SIGTERM, remember);
    return true;
  }();
  return listening && g_signal != 0;
}

}  // namespace anchord::cli
