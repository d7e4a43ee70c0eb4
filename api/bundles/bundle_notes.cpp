#include "api/bundles/bundle_notes.hpp"

#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/admin/flight_events.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/access_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_events = 100'000;
constexpr std::size_t k_looked_at = 20'000;  // of the audit log, newest first

void prepend(BundleNote& note, std::string line) {
  note.text.insert(0, std::move(line) + '\n');
  ++note.rows;
}

}  // namespace

std::vector<BundleNote> bundle_notes(const FlightEvents& events, AccessStore& audit, const Mission& mission,
                                     const Principal& who) {
  std::vector<BundleNote> out;
  BundleNote told{"events.ndjson", "", 0};
  if (const auto all = events.all(mission.id, k_most_events)) {
    for (const auto& event : all.value()) {
      told.text += event_json(event) + '\n';
      ++told.rows;
    }
  }
  out.push_back(std::move(told));
  if (!who.has(Role::admin)) return out;
  const auto entries = audit.audit(k_looked_at);
  if (!entries) return out;
  BundleNote log{"audit.ndjson", "", 0};
  const std::string id = to_string(mission.id);
  for (const auto& entry : entries.value()) {
    if (entry.what.find(id) == std::string::npos) continue;
    prepend(log, to_wire(nlohmann::ordered_json{{"at", to_rfc3339(entry.time)},
                                                {"who", entry.who},
                                                {"what", entry.what},
                                                {"from", entry.from},
                                                {"result", entry.result}}));
  }
  out.push_back(std::move(log));
  return out;
}

}  // namespace anchord::api
