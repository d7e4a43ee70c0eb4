#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <iterator>
#include <mutex>
#include <utility>
#include <vector>

#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord::server {

/// Rows on their way to the database, oldest first; the oldest leave when nobody takes them. Thread-safe.
class RowQueue {
 public:
  explicit RowQueue(std::size_t most_rows) : most_rows_(most_rows) {}
  template <class Row>
  void push(Row row) {
    const std::scoped_lock lock(mutex_);
    auto& rows = of(row);
    rows.push_back(std::move(row));
    if (fixes_.size() + ranges_.size() > most_rows_) {
      rows.pop_front();
      ++dropped_;
    }
    if (fixes_.size() + ranges_.size() >= k_batch_rows) told_.notify_one();
  }
  /// Waits for a batch's time or size; false when stopping and empty.
  bool take(std::vector<Fix>& fixes, std::vector<Range>& ranges) {
    std::unique_lock lock(mutex_);
    told_.wait_for(lock, k_batch_time,
                   [this] { return stopping_ || fixes_.size() + ranges_.size() >= k_batch_rows; });
    fixes.assign(std::make_move_iterator(fixes_.begin()), std::make_move_iterator(fixes_.end()));
    ranges.assign(std::make_move_iterator(ranges_.begin()), std::make_move_iterator(ranges_.end()));
    fixes_.clear();
    ranges_.clear();
    return !stopping_ || !fixes.empty() || !ranges.empty();
  }
  void stop() {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
    told_.notify_all();
  }
  bool stopping() const {
    const std::scoped_lock lock(mutex_);
    return stopping_;
  }
  void lost(std::size_t n) {
    const std::scoped_lock lock(mutex_);
    dropped_ += n;
  }
  std::uint64_t dropped() const {
    const std::scoped_lock lock(mutex_);
    return dropped_;
  }

 private:
  static constexpr auto k_batch_time = std::chrono::milliseconds(100);
  static constexpr std::size_t k_batch_rows = 200;
  std::deque<Fix>& of(const Fix&) { return fixes_; }
  std::deque<Range>& of(const Range&) { return ranges_; }
  const std::size_t most_rows_;
  mutable std::mutex mutex_;
  std::condition_variable told_;
  std::deque<Fix> fixes_;
  std::deque<Range> ranges_;
  std::uint64_t dropped_{0};
  bool stopping_{false};
};

}  // namespace anchord::server
