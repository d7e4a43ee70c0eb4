#include <map>
#include <memory>
#include <optional>
#include <variant>

#include "api/missions/mission_service_state.hpp"

namespace anchord::api {
namespace {

constexpr double k_moments = 240;  ///< of a flight that are kept
constexpr double k_least_step_s = 2;
constexpr std::size_t k_kept = 4;
constexpr double k_again_s = 30;  ///< of a flight that records, an answer serves so long

/// What was estimated since the last moment, the newest of each anchor.
void note(const MissionId& id, flight::LiveMission& live, std::string& items) {
  std::map<NetworkId, std::string> newest;
  for (const auto& event : live.take_events()) {
    if (const auto* estimated = std::get_if<flight::AnchorEstimated>(&event))
      newest[estimated->estimate.anchor] =
          live_estimate_json(id, estimated->estimate, estimated->models_moved_m);
    if (std::holds_alternative<flight::OriginMoved>(event)) items.clear();  // of another frame
  }
  for (const auto& [anchor, text] : newest) {
    if (!items.empty()) items += ',';
    items += text;
  }
}

}  // namespace

/// A flight of its own, which nobody else sees, given the stored rows as they came; what it estimates at some
/// moments is kept.
std::shared_ptr<const std::string> MissionService::State::replayed(const Mission& mission) {
  const auto& id = mission.id;
  StoredRows rows(deps.measurements, id, deps.predict_needs_cir());
  flight::LiveMission live(setup_of(mission));
  std::string items;
  const auto length_s = length_of(id);
  if (!length_s) return nullptr;
  const auto step_ns = static_cast<std::int64_t>(std::max(k_least_step_s, *length_s / k_moments) * 1e9);
  std::optional<std::int64_t> next_ns;
  const auto at = [&](UtcTime time) {
    if (!next_ns) next_ns = time.ns + step_ns;
    if (time.ns < *next_ns) return;
    live.settle();
    note(id, live, items);
    while (*next_ns <= time.ns) *next_ns += step_ns;
  };
  while (auto stored = rows.next()) {
    if (stopped) return nullptr;
    std::visit([&](const auto& row) { at(row.time); }, *stored);
    live.add(std::visit([&](auto& row) { return row_of(std::move(row)); }, *stored));
  }
  if (rows.failed()) return nullptr;
  if (mission.state == MissionState::finished) live.finish();
  live.settle();
  note(id, live, items);
  return std::make_shared<const std::string>(R"({"items":[)" + items + R"(],"next_cursor":null})");
}

/// From the first position to the last; a flight without any has no estimates. Absent: the store failed.
std::optional<double> MissionService::State::length_of(const MissionId& id) const {
  MeasurementStore::Filter filter;
  filter.mission = id;
  filter.limit = 1;
  const auto first = deps.measurements.fixes(filter);
  filter.descending = true;
  const auto last = deps.measurements.fixes(filter);
  if (!first || !last) return std::nullopt;
  if (first.value().rows.empty() || last.value().rows.empty()) return 0.0;
  return seconds_between(first.value().rows.front().time, last.value().rows.front().time);
}

std::shared_ptr<const std::string> MissionService::estimates_over_time(const MissionId& id) {
  auto& s = *state_;
  const auto mission = s.deps.missions.mission(id);
  const auto n_ranges = s.deps.measurements.count_ranges(id), n_fixes = s.deps.measurements.count_fixes(id);
  if (!mission || !n_ranges || !n_fixes) return nullptr;
  // Of a flight that records, an answer of a moment ago is as good: pages that are opened together ask once.
  const bool records = mission.value().state != MissionState::finished;
  const auto known = [&]() -> std::shared_ptr<const std::string> {
    const auto kept = s.histories.lock();
    for (const auto& one : *kept) {
      if (one.id != id) continue;
      if (records ? seconds_between(one.made, s.steady_now()) < k_again_s
                  : one.n_ranges == n_ranges.value() && one.n_fixes == n_fixes.value())
        return one.text;
    }
    return nullptr;
  };
  if (auto before = known()) return before;
  const std::scoped_lock one_at_a_time(s.reading_one);
  if (auto before = known()) return before;
  auto made = s.replayed(mission.value());
  if (!made) return nullptr;
  auto kept = s.histories.lock();
  std::erase_if(*kept, [&](const auto& one) { return one.id == id; });
  kept->push_back({id, n_ranges.value(), n_fixes.value(), s.steady_now(), made});
  if (kept->size() > k_kept) kept->pop_front();
  return made;
}

}  // namespace anchord::api
