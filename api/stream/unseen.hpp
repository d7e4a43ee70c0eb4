#pragma once

#include <cstdint>
#include <deque>

namespace anchord::api {

/// What a client was sent and has not read yet. A browser takes in all that its socket brings and works
/// through it later: the socket never fills, and a page on a weak machine shows what was true half a minute
/// ago. A client that reports what it has read is sent nothing more while that lags; what waits here is
/// replaced by what is newer. Not thread-safe.
class Unseen {
 public:
  /// Lag beyond the quickest report so far. A frame may wait 50 ms for its report and 50 ms for a tick.
  static constexpr std::int64_t k_lag_us = 250'000;
  /// Frames that may be unread at once. A page that needs 70 ms for each would be a second behind with those
  /// of a quarter of a second: by a late report the window becomes what the page reads within the lag; while
  /// it is full and all the same early, as on a long way, it grows.
  static constexpr std::size_t k_window = 8, k_narrowest = 4, k_widest = 64;
  /// No path needs longer; a longer quickest report comes of a queue.
  static constexpr std::int64_t k_longest_path_us = 1'000'000;

  void sent(std::int64_t now_us);
  /// The client has read its first `frames` frames. False where it was never sent so many.
  bool seen(std::uint64_t frames, std::int64_t now_us);
  /// Whether more may leave; always true for a client that reports nothing.
  bool open(std::int64_t now_us) const;

 private:
  struct Sent {
    std::int64_t at_us{};
    std::size_t place{};  ///< among the unread ones then, from 1
  };
  void judge(const Sent& frame, std::int64_t now_us);

  std::deque<Sent> unread_;                          ///< sent and not reported; empty before the first report
  std::uint64_t sent_{0}, seen_{0}, timed_from_{0};  ///< from there on it is known when a frame was sent
  std::int64_t quickest_us_{k_longest_path_us};
  std::size_t window_{k_window};
  bool was_full_{false};
  std::uint64_t judged_at_{0};  ///< what was sent before tells nothing of the window since
  bool reports_{false};
};

}  // namespace anchord::api
