#include "core/ports/event_store.hpp"

#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_insert_event =
    "INSERT INTO mission_event (id, mission_key, t_ns, level, code, text, lat_deg, lon_deg, "
    "height_above_ground_m) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) ON CONFLICT DO NOTHING";
constexpr const char* k_key_of_event =
    "SELECT event_key FROM mission_event WHERE id = ?1 AND mission_key = ?2";
constexpr const char* k_events =
    "SELECT id, t_ns, level, code, text, lat_deg, lon_deg, height_above_ground_m FROM mission_event WHERE "
    "mission_key = ?1 AND (?2 IS NULL OR t_ns >= ?2) AND (?3 IS NULL OR event_key < ?3) ORDER BY event_key "
    "DESC LIMIT ?4";

LiveEvent read_event(Query& query, const MissionId& mission) {
  LiveEvent event;
  event.id = query.id<EventId>();
  event.time = query.time();
  event.level = query.one_of(k_event_level_words);
  event.code = query.text();
  event.text = query.text();
  event.mission = mission;
  if (const auto lat_deg = query.maybe_real()) event.place = {*lat_deg, query.real(), query.real()};
  return event;
}

class SqlEventStore final : public EventStore {
 public:
  explicit SqlEventStore(Gate& gate) : gate_(gate) {}

  // Not through write_value: appended rows change nothing that is kept of other tables, as measurements.
  Result<void> append(std::span<const LiveEvent> events) override {
    const auto error = gate_.write(events.size(), [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_insert_event);
      for (const auto& event : events) {
        const auto mission = event.mission ? mission_key(c, *event.mission) : std::nullopt;
        if (!mission) continue;
        std::optional<double> lat_deg, lon_deg, height_m;
        if (event.place) {
          lat_deg = event.place->lat_deg;
          lon_deg = event.place->lon_deg;
          height_m = event.place->height_above_ground_m;
        }
        query.again();
        query << event.id << *mission << event.time << static_cast<int>(event.level) << event.code
              << event.text << lat_deg << lon_deg << height_m;
        query.run();
      }
      return std::nullopt;
    });
    if (error) return *error;
    return boost::outcome_v2::success();
  }

  Result<std::vector<LiveEvent>> events(const MissionId& mission, std::size_t limit,
                                        std::optional<UtcTime> since,
                                        const std::optional<EventId>& after) override {
    return read_value<std::vector<LiveEvent>>(gate_, [&](Connection& c) -> Result<std::vector<LiveEvent>> {
      std::vector<LiveEvent> found;
      const auto key = mission_key(c, mission);
      std::optional<std::int64_t> before;
      if (key && after) {
        Query place(c, k_key_of_event);
        place << *after << *key;
        if (!place.step()) return found;
        before = place.integer();
      }
      if (!key) return found;
      Query query(c, k_events);
      query << *key << since << before << row_limit(limit);
      while (query.step()) found.push_back(read_event(query, mission));
      return found;
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<EventStore> make_event_store(Gate& gate) { return std::make_unique<SqlEventStore>(gate); }

}  // namespace anchord::sql
