#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <variant>

#include "core/base/ids.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord::api {

/// All stored ranges and fixes of a mission in the order of time, a page of each in memory. Not thread-safe.
class StoredRows {
 public:
  static constexpr std::size_t k_page = 2000;
  StoredRows(MeasurementStore& store, const MissionId& mission, bool with_cir);
  /// Absent at the end, and when the store failed. Of two rows of one instant the fix comes first.
  std::optional<std::variant<Range, Fix>> next();
  bool failed() const { return failed_; }

 private:
  template <class Row>
  struct Stream {
    MeasurementStore::Filter filter;
    std::deque<Row> rows;
    bool more{true};
  };
  template <class Row, class Read>
  void refill(Stream<Row>& stream, Read read);
  template <class Row>
  static Row pop(Stream<Row>& stream);

  MeasurementStore& store_;
  Stream<Range> ranges_;
  Stream<Fix> fixes_;
  bool failed_{false};
};

}  // namespace anchord::api
