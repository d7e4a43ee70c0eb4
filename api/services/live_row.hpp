#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <tuple>
#include <variant>

#include "core/types/fix.hpp"
#include "core/types/range.hpp"
#include "core/types/range_model.hpp"

namespace anchord::api {

/// A range, and what the models that were promoted when it came say of it.
struct JudgedRange {
  Range range;
  std::optional<RangeModel> model;
  UtcTime time{};
};
/// What waits for a live flight.
using LiveRow = std::variant<JudgedRange, Fix>;

UtcTime time_of(const LiveRow& row);
/// Enough to know a row again that came both from the store and from the queue.
std::size_t identity(const LiveRow& row);
std::size_t identity(const Range& range);
std::size_t identity(const Fix& fix);

/// The newest time of each tag and anchor, and of the rover. What is newer is no repetition.
class NewestRows {
 public:
  /// Whether it is; from then on it is the newest.
  bool note(const Range& range);
  bool note(const Fix& fix);

 private:
  std::map<std::tuple<NetworkId, NetworkId, std::uint8_t>, UtcTime> ranges_;
  std::optional<UtcTime> fix_;
};

/// As a solution of the whole flight takes it: less the bias a model sees, unless nothing would be left.
Range corrected(const JudgedRange& judged);
/// What its model believes of the error that is left; nothing where corrected() took nothing off.
std::optional<RangeBelief> belief_of(const JudgedRange& judged);

}  // namespace anchord::api
