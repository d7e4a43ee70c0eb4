#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord::gateway {

/// How the rows of a batch are written, and with that where they go.
enum class Lines : std::uint8_t { fixes_csv, ranges_csv, ranges_ndjson };
inline constexpr auto k_lines_words = enum_table<Lines>({{"fixes_csv", Lines::fixes_csv},
                                                         {"ranges_csv", Lines::ranges_csv},
                                                         {"ranges_ndjson", Lines::ranges_ndjson}});

/// Rows that were measured while no mission was known: RFC 9562's Max UUID, which no mission has.
MissionId unassigned();

/// Rows of one kind that came together; they leave together.
struct Batch {
  std::int64_t id{};  ///< in the order of arrival; given by the outbox
  MissionId mission{};
  Lines lines{};
  std::uint32_t n_rows{};
  UtcTime newest{};  ///< measured
  std::string body;  ///< one row a line, without a header
};

/// Since the outbox was made; kept with the rows.
struct Totals {
  std::uint64_t kept{}, accepted{}, duplicates{}, rejected{};
};
struct OutboxState {
  std::uint64_t rows{}, bytes{}, max_bytes{}, unassigned_rows{};
  std::int64_t newest_id{};  ///< of the newest batch there ever was
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
/// (docs/adr/0011-outbox.md). Bounded: full, it keeps what it has and refuses what comes. Thread-safe.
class Outbox {
 public:
  /// Opens or makes DIR/outbox.db. Errors: conflict (another process has the folder, or it is a server's),
  /// unsupported (no outbox, or a newer one), storage_unavailable (damaged), storage_full.
  static Result<std::unique_ptr<Outbox>> open(const std::filesystem::path& dir, std::uint64_t max_bytes);
  ~Outbox();
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  /// Returns when they are on the disk. Errors: storage_full (its own bound, or the disk's),
  /// storage_unavailable; nothing is kept then.
  Result<void> keep(std::vector<Batch> batches);
  /// The newest that came after `after`, as many as fit; one at least. Those without a mission are left out.
  Result<Newest> newest(std::int64_t after, std::uint64_t max_bytes);
  /// The oldest up to `until` of one mission that is not in `held`, oldest first, as many as fit.
  Result<std::vector<Batch>> oldest(std::int64_t until, const std::set<MissionId>& held,
                                    std::uint64_t max_bytes);
  /// They leave, and the totals grow, in one transaction.
  Result<void> delivered(const Delivered& delivered);
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
