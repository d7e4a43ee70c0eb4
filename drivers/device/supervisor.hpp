#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/enum_table.hpp"

namespace anchord::device {

enum class Phase : std::uint8_t {
  lost,     ///< no link: not plugged in, did not open, or was pulled; the next try has a time
  found,    ///< the port is there and being opened
  open,     ///< bytes can flow, no good frame yet
  talking,  ///< good frames come
  silent,   ///< the link is open and nothing good has come for too long
};
inline constexpr auto k_phase_words = enum_table<Phase>({{"lost", Phase::lost},
                                                         {"found", Phase::found},
                                                         {"open", Phase::open},
                                                         {"talking", Phase::talking},
                                                         {"silent", Phase::silent}});
constexpr std::string_view to_string(Phase phase) { return k_phase_words.word(phase); }

struct SupervisorOptions {
  std::int64_t first_wait_ns = 500'000'000;  ///< after a loss; doubles with every failure
  std::int64_t longest_wait_ns =
      4'000'000'000;     ///< reopened within 5 s of a replug even without hot-plug events
  double jitter = 0.25;  ///< share of the wait drawn at random: not all devices at once
  std::int64_t silent_after_ns = 2'000'000'000;   ///< reliability.md: seen in 2 s
  std::int64_t reopen_after_ns = 10'000'000'000;  ///< of silence: USB converters hang and come back by this
};

/// What the machine remembers. Times are steady ns.
struct Supervision {
  Phase phase{Phase::lost};
  std::string reason{"not opened yet"};  ///< why it is not talking, one line; empty while it is
  int failures{0};                       ///< on end, without a good frame between
  std::int64_t since_ns{0};              ///< in this phase
  std::int64_t quiet_since_ns{0};        ///< opened or last heard, whichever is later
  std::int64_t try_at_ns{0};             ///< when lost
};

enum class Happened : std::uint8_t {
  tick,      ///< time has passed
  appeared,  ///< the port was not there and is now
  opened,
  closed,  ///< or did not open; with the reason
  heard,   ///< a good frame
};
struct Occurrence {
  Happened what{Happened::tick};
  std::int64_t now_ns{};
  double uniform{0.5};  ///< of [0, 1), for the jitter: chance comes from outside
  std::string reason{};
  std::int64_t not_before_ns{0};  ///< closed: the other side asked for this pause at least
};

enum class Wanted : std::uint8_t { nothing, open, close };
struct SupervisorStep {
  Supervision next;
  Wanted wanted{Wanted::nothing};
};

/// Pure: no clock, no port. `close` is followed by nothing: the machine is lost already when it asks for it.
SupervisorStep advance(const Supervision& state, const Occurrence& occurrence,
                       const SupervisorOptions& options = {});
/// When the next tick is due; absent: not before something happens.
std::optional<std::int64_t> deadline_ns(const Supervision& state, const SupervisorOptions& options = {});

}  // namespace anchord::device
