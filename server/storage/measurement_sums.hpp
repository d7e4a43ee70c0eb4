#pragma once

#include <cstdint>
#include <map>
#include <tuple>

#include "core/ports/measurement_store.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"
#include "server/storage/sql.hpp"

namespace anchord::sql {

/// What was added in one transaction, by radio and by mission, so that each device, and the count of a
/// mission's fixes, costs one statement and not one a row.
class MeasurementSums {
 public:
  void note(std::int64_t mission_key, const Range& row);
  void note(std::int64_t mission_key, const Fix&) { ++fixes_[mission_key]; }
  /// Adds them to what is kept (device_seen, mission_fixes).
  void store(Connection& connection) const;

 private:
  struct Seen {
    UtcTime first{}, last{};
    std::int64_t n{0};
  };
  using Device = std::tuple<std::int64_t, std::uint32_t, DeviceSeen::Kind>;
  void add(const Device& device, UtcTime time);
  std::map<Device, Seen> seen_;
  std::map<std::int64_t, std::int64_t> fixes_;  // by mission
};

}  // namespace anchord::sql
