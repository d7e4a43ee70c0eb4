#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "server/gateway/batch.hpp"

namespace anchord::gateway {

struct OutboxState {
  std::uint64_t rows{};  ///< that wait, those in memory among them
  std::uint64_t bytes{}, max_bytes{}, unassigned_rows{};
  std::uint64_t rows_in_memory{};  ///< alone, since the disk does not take them
  std::string trouble;             ///< why the disk took nothing at the last attempt; empty: it did
  std::int64_t newest_id{};        ///< of the newest batch there ever was
  Totals totals;
};

/// What fits into one request.
struct Newest {
  std::vector<Batch> batches;  ///< newest first
  bool more{false};            ///< others came after the mark and did not fit
};

/// The answers to rows that leave the outbox.
struct Delivered {
  std::vector<std::int64_t> ids;
  std::uint64_t accepted{}, duplicates{}, rejected{};
};

/// Rows on the disk until the server has answered for them: an SQLite file, WAL, synced at each commit
/// (docs/adr/0011-outbox.md). Bounded: full, it keeps what it has and refuses what comes. What a full or
/// broken disk does not take can be held in memory meanwhile, and rows go to the server all the same.
/// Thread-safe.
class Outbox {
 public:
  static constexpr std::uint64_t k_most_held_bytes = 16u << 20;

  /// Opens DIR/outbox.db, or makes it where there never was one; with `anew` also where one is missing.
  /// Errors: conflict (another process has the folder, or it is a server's), unsupported (no outbox, or a
  /// newer one), storage_unavailable (damaged, or missing), storage_full.
  static Result<std::unique_ptr<Outbox>> open(const std::filesystem::path& dir, std::uint64_t max_bytes,
                                              bool anew = false);
  ~Outbox();
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  /// Returns when they are on the disk. Errors: storage_full (its own bound, or the disk's),
  /// storage_unavailable; nothing is kept then.
  Result<void> keep(std::vector<Batch> batches);
  /// What keep() refused: in memory until the server has it or the disk takes it, whichever is first. False:
  /// there is no room for it (k_most_held_bytes).
  bool hold(std::vector<Batch> batches);
  /// Where the disk took nothing: again, with all that waits for it. True: nothing waits for it.
  bool try_disk();
  /// The newest that came after `after`, as many as fit; one at least. Those without a mission are left out.
  Result<Newest> newest(std::int64_t after, std::uint64_t max_bytes);
  /// The oldest up to `until` of one mission that is not in `held`, oldest first, as many as fit.
  Result<std::vector<Batch>> oldest(std::int64_t until, const std::set<MissionId>& held,
                                    std::uint64_t max_bytes);
  /// They leave, and the totals grow, in one transaction. Where the disk takes no such change they are not
  /// sent again by this process, and deleted once it does. False: the disk does not yet.
  bool delivered(const Delivered& delivered);
  /// Rows without a mission are of this one. returns  how many
  Result<std::uint64_t> assign(const MissionId& mission);

  /// The mission that rows were last kept for, and when that was last so.
  struct LastMission {
    MissionId mission;
    UtcTime at;
  };
  Result<std::optional<LastMission>> last_mission();
  Result<void> note_mission(const LastMission& mission);

  OutboxState state() const;
  /// When the oldest row that waits was measured.
  std::optional<UtcTime> oldest_waiting();

 private:
  struct State;
  explicit Outbox(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace anchord::gateway
