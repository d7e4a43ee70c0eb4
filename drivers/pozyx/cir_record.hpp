#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "drivers/port/driver.hpp"

namespace anchord::pozyx {

/// What CirRead::window asks a tag for: the first path and 60 ns of echoes, and noise from before any path.
inline constexpr std::size_t k_window_from = 672, k_window_taps = 128;
inline constexpr std::size_t k_noise_from = 300, k_noise_taps = 32;

/// Taps as read, interleaved re, im. Window: `taps` begins at `from`, and `noise` is beside it.
struct CirRecord {
  std::vector<std::int16_t> taps, noise;
  std::size_t from{};
};

/// The window that a tag would be asked for, out of a whole record (2 x at least 800 values).
CirRecord window_of(std::span<const std::int16_t> whole);

/// Gives a range its impulse response and what the diagnosis says of it; rss_dbm must be set before.
/// prf_constant_db  A of eq 5.6, as of diagnose()
void take_record(Range& range, CirRecord record, double prf_constant_db);

}  // namespace anchord::pozyx
