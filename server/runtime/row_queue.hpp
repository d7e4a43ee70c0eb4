#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <iterator>
#include <utility>

#include "core/base/locked.hpp"
#include "core/ports/devices.hpp"

namespace anchord::server {

/// Rows on their way from one thread to another, oldest first; the oldest leave when nobody takes them.
/// Thread-safe.
class RowQueue {
 public:
  RowQueue(std::size_t most_rows, std::chrono::milliseconds batch_time)
      : most_rows_(most_rows), batch_time_(batch_time) {}
  void push(DeviceBatch batch) {
    auto rows = rows_.lock();
    for (auto& row : batch.fixes) rows->add(rows->fixes, std::move(row), most_rows_);
    for (auto& row : batch.ranges) rows->add(rows->ranges, std::move(row), most_rows_);
    if (rows->size() >= k_batch_rows) told_.notify_one();
  }
  /// Waits for a batch's time or size; false when stopping and empty.
  bool take(DeviceBatch& batch) {
    auto rows = rows_.lock();
    rows.wait_for(told_, batch_time_, [](const Rows& r) { return r.stopping || r.size() >= k_batch_rows; });
    batch.fixes.assign(std::make_move_iterator(rows->fixes.begin()),
                       std::make_move_iterator(rows->fixes.end()));
    batch.ranges.assign(std::make_move_iterator(rows->ranges.begin()),
                        std::make_move_iterator(rows->ranges.end()));
    rows->fixes.clear();
    rows->ranges.clear();
    return !rows->stopping || !batch.empty();
  }
  void stop() {
    auto rows = rows_.lock();
    rows->stopping = true;
    told_.notify_all();
  }
  bool stopping() const {
    const auto rows = rows_.lock();
    return rows->stopping;
  }
  void lost(std::size_t n) {
    auto rows = rows_.lock();
    rows->dropped += n;
  }
  std::uint64_t dropped() const {
    const auto rows = rows_.lock();
    return rows->dropped;
  }

 private:
  static constexpr std::size_t k_batch_rows = 200;
  struct Rows {
    std::size_t size() const { return fixes.size() + ranges.size(); }
    template <class Row>
    void add(std::deque<Row>& of_kind, Row row, std::size_t most) {
      of_kind.push_back(std::move(row));
      if (size() <= most) return;
      of_kind.pop_front();
      ++dropped;
    }
    std::deque<Fix> fixes{};
    std::deque<Range> ranges{};
    std::uint64_t dropped{0};
    bool stopping{false};
  };
  const std::size_t most_rows_;
  const std::chrono::milliseconds batch_time_;
  std::condition_variable told_;
  Locked<Rows> rows_;
};

}  // namespace anchord::server
