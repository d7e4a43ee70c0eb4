#include "api/services/device_ingest.hpp"

#include <set>

#include "api/services/mission_service.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {
namespace {

template <class Row>
void prepare(MissionService& missions, const std::vector<Row>& rows) {
  std::set<MissionId> seen;
  for (const auto& row : rows) {
    if (seen.insert(row.mission).second) missions.prepare(row.mission);
  }
}

template <class Row>
std::vector<Row> stored(std::vector<Row> rows, const std::vector<RowOutcome>& outcomes) {
  std::vector<Row> out;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    if (outcomes[i] == RowOutcome::accepted) out.push_back(std::move(rows[i]));
  }
  return out;
}

}  // namespace

Result<void> DeviceIngest::take(std::vector<Fix> fixes, std::vector<Range> ranges) {
  prepare(missions_, fixes);
  prepare(missions_, ranges);
  if (!fixes.empty()) {
    BOOST_OUTCOME_TRY(const auto outcomes, store_.append_fixes(fixes, false));
    if (auto fresh = stored(std::move(fixes), outcomes); !fresh.empty()) missions_.accepted(std::move(fresh));
  }
  if (!ranges.empty()) {
    auto live = ranges;
    // A live row needs no impulse response, and it is 4 kB; only some models look at it.
    if (!missions_.wants_cir())
      for (auto& range : live) range.cir.reset();
    BOOST_OUTCOME_TRY(const auto outcomes, store_.append_ranges(std::move(ranges), false));
    if (auto fresh = stored(std::move(live), outcomes); !fresh.empty()) missions_.accepted(std::move(fresh));
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::api
