#include "api/services/device_ingest.hpp"

#include <set>

#include "api/services/mission_service.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {
namespace {

template <class Row>
void prepare(MissionService& missions, const std::vector<Arrived<Row>>& rows) {
  std::set<MissionId> seen;
  for (const auto& [row, live] : rows) {
    if (seen.insert(row.mission).second) missions.prepare(row.mission);
  }
}

template <class Row>
std::vector<Row> rows_of(const std::vector<Arrived<Row>>& arrived) {
  std::vector<Row> out;
  out.reserve(arrived.size());
  for (const auto& one : arrived) out.push_back(one.row);
  return out;
}

}  // namespace

void DeviceIngest::live(DeviceBatch& batch) {
  missions_.arrived(batch.fixes);
  missions_.arrived(batch.ranges);
}

Result<void> DeviceIngest::store(const DeviceBatch& batch) {
  prepare(missions_, batch.fixes);
  prepare(missions_, batch.ranges);
  if (!batch.fixes.empty()) {
    BOOST_OUTCOME_TRY(const auto outcomes, store_.append_fixes(rows_of(batch.fixes), false));
    missions_.accepted(batch.fixes, outcomes);
  }
  if (!batch.ranges.empty()) {
    BOOST_OUTCOME_TRY(const auto outcomes, store_.append_ranges(rows_of(batch.ranges), false));
    missions_.accepted(batch.ranges, outcomes);
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::api
