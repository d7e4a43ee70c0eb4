#include "api/measurements/device_ingest.hpp"

#include <set>

#include "api/missions/mission_service.hpp"
#include "core/ports/measurement_store.hpp"

namespace anchord::api {
namespace {

template <class Row>
void prepare(MissionService& missions, const std::vector<Row>& rows) {
  std::set<MissionId> seen;
  for (const auto& row : rows) {
    if (seen.insert(row.mission).second) missions.prepare(row.mission);
  }
}

}  // namespace

void DeviceIngest::live(const DeviceBatch& batch) {
  missions_.arrived(batch.fixes);
  missions_.arrived(batch.ranges);
}

Result<void> DeviceIngest::store(const DeviceBatch& batch) {
  prepare(missions_, batch.fixes);
  prepare(missions_, batch.ranges);
  if (!batch.fixes.empty()) {
    BOOST_OUTCOME_TRY(const auto outcomes, store_.append_fixes(batch.fixes, false));
    missions_.accepted(batch.fixes, outcomes);
  }
  if (!batch.ranges.empty()) {
    BOOST_OUTCOME_TRY(const auto outcomes, store_.append_ranges(batch.ranges, false));
    missions_.accepted(batch.ranges, outcomes);
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::api
