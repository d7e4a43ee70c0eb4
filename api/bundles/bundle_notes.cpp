#include "api/bundles/bundle_notes.hpp"

#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/access_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_looked_at = 20'000;  // of the audit log, newest first

void prepend(BundleNote& note, std::string line) {
  note.text.insert(0, std::move(line) + '\n');
  ++note.rows;
}

}  // namespace

std::vector<BundleNote> bundle_notes(const EventLog& events, AccessStore& audit, const Mission& mission,
                                     const Principal& who) {
  std::vector<BundleNote> out;
  BundleNote told{"events.ndjson", "", 0};
  for (const auto& event : events.newest(EventLog::k_kept, mission.id, {})) prepend(told, event_json(event));
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
