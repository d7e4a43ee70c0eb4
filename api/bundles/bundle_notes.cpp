#include "api/bundles/bundle_notes.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/admin/flight_events.hpp"
#include "api/formats/bundle.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/access_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_events = 100'000;
constexpr std::size_t k_looked_at = 20'000;  // of the audit log, newest first

constexpr const char* k_events = "events.ndjson";
constexpr std::size_t k_code_characters = 100;

std::optional<EventPlace> read_place(const nlohmann::json* place, std::vector<FieldError>& errors) {
  if (place == nullptr) return std::nullopt;
  Fields fields(*place, "/place", errors);
  const auto lon_deg = fields.number("lon", -180, 180, true), lat_deg = fields.number("lat", -90, 90, true),
             height_m = fields.number("height_above_ground_m", -10'000, 10'000, true);
  if (!lon_deg || !lat_deg || !height_m) return std::nullopt;
  return EventPlace{*lat_deg, *lon_deg, *height_m};
}

/// A line of events.ndjson. Members that came later than this version are left alone.
std::optional<LiveEvent> read_event(std::string_view line, const MissionId& mission) {
  nlohmann::json json;
  if (parse_json(line, json)) return std::nullopt;
  std::vector<FieldError> errors;
  Fields fields(json, "", errors);
  const auto id = parse_uuid(fields.text("id", 40, true).value_or(""));
  const auto t_us = fields.integer("t_us", 0, record_limits::k_latest_us, true);
  const auto level = fields.word("level", k_event_level_words, true);
  auto code = fields.text("code", k_code_characters, true),
       text = fields.text("text", record_limits::k_words, true);
  const auto place = read_place(fields.child("place"), errors);
  if (!errors.empty() || !id) return std::nullopt;
  return LiveEvent{.id = EventId{id.value()},
                   .time = UtcTime::from_us(*t_us),
                   .level = *level,
                   .code = *std::move(code),
                   .text = *std::move(text),
                   .mission = mission,
                   .place = place};
}

void prepend(BundleNote& note, std::string line) {
  note.text.insert(0, std::move(line) + '\n');
  ++note.rows;
}

}  // namespace

std::vector<BundleNote> bundle_notes(const FlightEvents& events, AccessStore& audit, const Mission& mission,
                                     const Principal& who) {
  std::vector<BundleNote> out;
  BundleNote noted{k_events, "", 0};
  if (const auto all = events.all(mission.id, k_most_events)) {
    for (const auto& event : all.value()) {
      noted.text += event_json(event) + '\n';
      ++noted.rows;
    }
  }
  out.push_back(std::move(noted));
  if (!who.has(Role::admin) || !who.sites.all()) return out;
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

Result<std::vector<LiveEvent>> noted_events(const ZipReader& zip, const BundleManifest& manifest) {
  std::vector<LiveEvent> out;
  const std::string name = std::string(k_bundle_notes) + k_events;
  if (std::ranges::find(manifest.entries, name, &BundleEntry::name) == manifest.entries.end()) return out;
  BOOST_OUTCOME_TRY(auto lines, ZipLines::open(zip, name));
  std::string_view line;
  for (;;) {
    BOOST_OUTCOME_TRY(const bool more, lines.next(line));
    if (!more) return out;
    auto event = read_event(line, manifest.mission);
    if (!event || out.size() >= k_most_events)
      return make_error(Errc::bad_frame, name + " line " + std::to_string(lines.number()) +
                                             (event ? ": more than 100000 events" : ": not an event"));
    out.push_back(*std::move(event));
  }
}

}  // namespace anchord::api
