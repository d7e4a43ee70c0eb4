#include "server/storage/measurement_sums.hpp"

#include <algorithm>

namespace anchord::sql {
namespace {

constexpr const char* k_note_device =
    "INSERT INTO device_seen (mission_key, network_id, kind, first_t_ns, last_t_ns, n_ranges) VALUES (?1, "
    "?2, ?3, ?4, ?5, ?6) ON CONFLICT (mission_key, network_id, kind) DO UPDATE SET "
    "first_t_ns = CASE WHEN excluded.first_t_ns < device_seen.first_t_ns THEN excluded.first_t_ns ELSE "
    "device_seen.first_t_ns END, last_t_ns = CASE WHEN excluded.last_t_ns > device_seen.last_t_ns THEN "
    "excluded.last_t_ns ELSE device_seen.last_t_ns END, n_ranges = device_seen.n_ranges + excluded.n_ranges";
constexpr const char* k_note_fixes =
    "INSERT INTO mission_fixes (mission_key, n_fixes) VALUES (?1, ?2) "
    "ON CONFLICT (mission_key) DO UPDATE SET n_fixes = mission_fixes.n_fixes + excluded.n_fixes";

}  // namespace

void MeasurementSums::note(std::int64_t mission_key, const Range& row) {
  add({mission_key, row.anchor.value, DeviceSeen::Kind::anchor}, row.time);
  add({mission_key, row.tag.value,
       row.kind == RangeKind::tag_anchor ? DeviceSeen::Kind::tag : DeviceSeen::Kind::anchor},
      row.time);
}

void MeasurementSums::store(Connection& connection) const {
  for (const auto& [key, n] : fixes_) {
    Query query(connection, k_note_fixes);
    query << key << n;
    query.run();
  }
  for (const auto& [device, seen] : seen_) {
    const auto& [key, network_id, kind] = device;
    Query query(connection, k_note_device);
    query << key << NetworkId{network_id} << static_cast<int>(kind) << seen.first << seen.last << seen.n;
    query.run();
  }
}

void MeasurementSums::add(const Device& device, UtcTime time) {
  auto [it, fresh] = seen_.try_emplace(device, Seen{time, time, 0});
  it->second.first = std::min(it->second.first, time);
  it->second.last = std::max(it->second.last, time);
  ++it->second.n;
}

}  // namespace anchord::sql
