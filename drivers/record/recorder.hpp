#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "drivers/record/event.hpp"

namespace anchord::record {

struct RecorderOptions {
  std::uint64_t rotate_bytes = 256u << 20;
  std::int64_t sync_every_ms =
      1'000;  ///< fdatasync, on a thread of its own: the power may go, a process may not
  /// Of the disk, left to what is made of these bytes: rows are a tenth of them and worth more.
  std::uint64_t keep_free_bytes = 256u << 20;
  /// With less than this free, the oldest parts that no flight is in are removed, so that the next flight is
  /// not refused (at 500 MiB). 0: never.
  std::uint64_t make_room_bytes = 1u << 30;
  /// Hears of each part that is removed; called on the recorder's own thread.
  std::function<void(const std::filesystem::path& part)> removed{};
};

/// Appends every event to a file before anybody parses it. Each record goes to the kernel in one write, so a
/// killed process loses nothing that was handed over and a power cut at most the last second; a torn tail is
/// cut by the reader. Files are `<UTC of the start>-NNNN.anrec`, a new one at rotate_bytes; each begins with
/// the devices there are, so that any part replays alone.
///
/// A full disk, or one with less than keep_free_bytes, stops the recording, not the flight: take() then
/// counts, and tries again after ten seconds of event time. Before that, parts without a flight make room. A
/// part that is removed, renamed or replaced meanwhile is noticed at the next sync, and the next one begun.
/// One thread calls; failed() and counters from any.
class Recorder {
 public:
  static Result<std::unique_ptr<Recorder>> open(const std::filesystem::path& folder, UtcTime now,
                                                const RecorderOptions& options = {});
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  void take(const Event& event);
  /// Why nothing is being recorded, or does not reach the disk; empty while it does.
  std::string failed() const;
  std::uint64_t bytes_written() const;
  std::uint64_t events_lost() const;
  std::filesystem::path file() const;  ///< being written

 private:
  struct State;
  explicit Recorder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Whether a part may hold bytes of a flight: a mission records somewhere in it, or it cannot be read to its
/// end (a torn tail is none).
bool may_hold_a_flight(const std::filesystem::path& part);

/// The parts of one recording in order: the file itself and those after it of the same start in its folder.
Result<std::vector<std::filesystem::path>> parts_of(const std::filesystem::path& file);

}  // namespace anchord::record
