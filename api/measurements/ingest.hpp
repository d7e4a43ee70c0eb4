#pragma once

#include <atomic>
#include <cstdint>

#include "api/kit/message.hpp"

namespace anchord {
class MeasurementStore;
}

namespace anchord::api {

class MissionService;

/// Lines seen since the start, for the metrics.
struct IngestCounters {
  std::atomic<std::uint64_t> accepted{0}, duplicates{0}, rejected{0};
};

/// POST /ranges and /fixes: single JSON, JSON array, NDJSON or CSV into the store, batches of 1 000 rows, and
/// from there into the live path once committed. NDJSON and CSV run in constant memory; a JSON array is one
/// document and is held (32 MiB at most), so that a broken one stores nothing. `?atomic=true` holds the rows
/// as well. Thread-safe; blocks on the database.
class IngestService {
 public:
  static constexpr std::uint64_t k_max_body_bytes = 32u << 20;

  IngestService(MeasurementStore& store, MissionService& missions) : store_(store), missions_(missions) {}
  Response ranges(const Request& request);
  Response fixes(const Request& request);
  const IngestCounters& counters() const { return counters_; }

 private:
  template <class Row>
  friend class IngestRun;
  MeasurementStore& store_;
  MissionService& missions_;
  IngestCounters counters_;
};

}  // namespace anchord::api
