#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/gateway/batch.hpp"

namespace anchord::gateway {

/// What a disk that takes nothing owes: batches that are in memory alone, and those that the server has and
/// that could not be deleted. Both leave it with the first write that succeeds. Of one thread at a time.
class DiskDebt {
 public:
  using Held = std::shared_ptr<const Batch>;

  /// Into memory; false where that would be more than `max_bytes`, and nothing is held then.
  bool hold(std::vector<Batch> batches, std::uint64_t max_bytes);
  /// By id.
  const std::map<std::int64_t, Held>& held() const { return held_; }
  std::uint64_t held_rows() const { return held_rows_; }
  std::uint64_t held_bytes() const { return held_bytes_; }
  /// It is at the server. returns  its rows; nothing where it was not here
  std::optional<std::uint64_t> release(std::int64_t id);
  /// All that is held is on the disk.
  void stored();
  /// Those without a mission are of this one now. returns  their rows
  std::uint64_t assign(const MissionId& mission);

  /// At the server and still on the disk: never sent again by this process.
  std::set<std::int64_t> undeleted;
  Totals uncounted;     ///< not yet in the file
  std::string trouble;  ///< why the disk took nothing; empty: it does

  bool none() const { return held_.empty() && undeleted.empty() && uncounted == Totals{}; }

 private:
  std::map<std::int64_t, Held> held_;
  std::uint64_t held_rows_{0}, held_bytes_{0};
};

}  // namespace anchord::gateway
