#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <tuple>
#include <unordered_set>
#include <variant>

#include "core/types/fix.hpp"
#include "core/types/range.hpp"
#include "core/types/range_model.hpp"

namespace anchord::flight {

/// A range, and what the models that were promoted when it came say of it.
struct PredictedRange {
  Range range;
  std::optional<RangeModel> model;
  UtcTime time{};
  bool silent{false};  ///< models are promoted, and none of them has anything to say of it
};
/// What waits for a live flight.
using LiveRow = std::variant<PredictedRange, Fix>;

UtcTime time_of(const LiveRow& row);
/// Enough to know a row again that came both from the store and from the queue.
std::size_t identity(const LiveRow& row);
std::size_t identity(const Range& range);
std::size_t identity(const Fix& fix);

/// What a live flight may take before the store has spoken, and what of it the store has not spoken for. Not
/// thread-safe.
class RowsAhead {
 public:
  /// `most` of the newest that were taken are remembered.
  explicit RowsAhead(std::size_t most) : most_(most) {}
  /// Whether it is newer than all before of its tag and anchor, or of the rover: then it is no repetition,
  /// and taken.
  template <class Row>
  bool take(const Row& row) {
    if (!note(row)) return false;
    const auto id = identity(row);
    taken_.insert(id);
    order_.push_back(id);
    if (order_.size() > most_) {
      taken_.erase(order_.front());
      order_.pop_front();
    }
    return true;
  }
  /// The store has accepted it. Whether it was taken before.
  template <class Row>
  bool settle(const Row& row) {
    note(row);
    return taken_.erase(identity(row)) > 0;
  }
  /// It is stored. Whether it is the newest.
  bool note(const Range& range);
  bool note(const Fix& fix);
  /// The live flight begins anew: what it took counts no more.
  void forget() { taken_.clear(); }

 private:
  std::size_t most_;
  std::map<std::tuple<NetworkId, NetworkId, std::uint8_t>, UtcTime> ranges_;
  std::optional<UtcTime> fix_;
  std::unordered_set<std::size_t> taken_;
  std::deque<std::size_t> order_;
};

/// As a solution of the whole flight takes it: less the bias a model sees, unless nothing would be left.
Range corrected(const PredictedRange& judged);
/// What its model believes of the error that is left; nothing where corrected() took nothing off.
std::optional<RangeErrorModel> error_model_of(const PredictedRange& judged);

}  // namespace anchord::flight
