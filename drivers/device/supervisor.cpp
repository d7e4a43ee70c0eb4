#include "drivers/device/supervisor.hpp"

#include <algorithm>

namespace anchord::device {
namespace {

void enter(Supervision& state, Phase phase, std::int64_t now_ns) {
  if (state.phase != phase) state.since_ns = now_ns;
  state.phase = phase;
}

void lose(Supervision& state, const Occurrence& why, const SupervisorOptions& options,
          const std::string& reason) {
  enter(state, Phase::lost, why.now_ns);
  state.reason = reason;
  auto wait = options.first_wait_ns;
  for (int i = 0; i < state.failures && wait < options.longest_wait_ns; ++i) wait *= 2;
  wait = std::min(wait, options.longest_wait_ns);
  const double share = 1 - options.jitter + options.jitter * why.uniform;  // never longer than the longest
  state.try_at_ns =
      why.now_ns + std::max(static_cast<std::int64_t>(static_cast<double>(wait) * share), why.not_before_ns);
  ++state.failures;
}

}  // namespace

SupervisorStep advance(const Supervision& state, const Occurrence& occurrence,
                       const SupervisorOptions& options) {
  SupervisorStep step{state};
  auto& next = step.next;
  const auto now = occurrence.now_ns;
  const bool linked = state.phase != Phase::lost;
  switch (occurrence.what) {
    case Happened::appeared:
      if (linked) break;
      next.failures = 0;
      next.try_at_ns = now;
      [[fallthrough]];
    case Happened::tick:
      if (!linked) {
        if (now < next.try_at_ns) break;
        enter(next, Phase::found, now);
        step.wanted = Wanted::open;
      } else if (state.phase == Phase::open || state.phase == Phase::talking) {
        if (now - state.quiet_since_ns < options.silent_after_ns) break;
        enter(next, Phase::silent, now);
        next.reason = "the link is open, but nothing is received";
      } else if (state.phase == Phase::silent && now - state.quiet_since_ns >= options.reopen_after_ns) {
        lose(next, occurrence, options, "nothing received for too long: opened again");
        step.wanted = Wanted::close;
      }
      break;
    case Happened::opened:
      if (!linked) break;  // of a link that was given up meanwhile
      enter(next, Phase::open, now);
      next.reason = "waiting for the first readable bytes";
      next.quiet_since_ns = now;
      break;
    case Happened::closed:
      if (linked) lose(next, occurrence, options, occurrence.reason);
      break;
    case Happened::heard:
      if (!linked) break;
      enter(next, Phase::talking, now);
      next.quiet_since_ns = now;
      next.reason.clear();
      next.failures = 0;
      break;
  }
  return step;
}

std::optional<std::int64_t> deadline_ns(const Supervision& state, const SupervisorOptions& options) {
  switch (state.phase) {
    case Phase::lost:
      return state.try_at_ns;
    case Phase::found:
      return std::nullopt;  // opening has its own deadline
    case Phase::open:
    case Phase::talking:
      return state.quiet_since_ns + options.silent_after_ns;
    case Phase::silent:
      return state.quiet_since_ns + options.reopen_after_ns;
  }
  return std::nullopt;
}

}  // namespace anchord::device
