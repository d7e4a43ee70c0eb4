#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <iterator>
#include <mutex>
#include <utility>

#include "core/ports/devices.hpp"

namespace anchord::server {

/// Rows on their way from one thread to another, oldest first; the oldest leave when nobody takes them.
/// Thread-safe.
class RowQueue {
 public:
  RowQueue(std::size_t most_rows, std::chrono::milliseconds batch_time)
      : most_rows_(most_rows), batch_time_(batch_time) {}
  void push(DeviceBatch batch) {
    const std::scoped_lock lock(mutex_);
    for (auto& row : batch.fixes) add(std::move(row));
    for (auto& row : batch.ranges) add(std::move(row));
    if (size() >= k_batch_rows) told_.notify_one();
  }
  /// Waits for a batch's time or size; false when stopping and empty.
  bool take(DeviceBatch& batch) {
    std::unique_lock lock(mutex_);
    told_.wait_for(lock, batch_time_, [this] { return stopping_ || size() >= k_batch_rows; });
    batch.fixes.assign(std::make_move_iterator(fixes_.begin()), std::make_move_iterator(fixes_.end()));
    batch.ranges.assign(std::make_move_iterator(ranges_.begin()), std::make_move_iterator(ranges_.end()));
    fixes_.clear();
    ranges_.clear();
    return !stopping_ || !batch.empty();
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
  static constexpr std::size_t k_batch_rows = 200;
  std::deque<Fix>& of(const Fix&) { return fixes_; }
  std::deque<Range>& of(const Range&) { return ranges_; }
  std::size_t size() const { return fixes_.size() + ranges_.size(); }
  template <class Row>
  void add(Row row) {
    auto& rows = of(row);
    rows.push_back(std::move(row));
    if (size() <= most_rows_) return;
    rows.pop_front();
    ++dropped_;
  }
  const std::size_t most_rows_;
  const std::chrono::milliseconds batch_time_;
  mutable std::mutex mutex_;
  std::condition_variable told_;
  std::deque<Fix> fixes_;
  std::deque<Range> ranges_;
  std::uint64_t dropped_{0};
  bool stopping_{false};
};

}  // namespace anchord::server
