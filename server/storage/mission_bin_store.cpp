#include <array>

#include "core/ports/mission_bin.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_mission_bin_state =
    "SELECT mission_key, state FROM mission WHERE id = ?1 AND mission_key NOT IN "
    "(SELECT mission_key FROM mission_bin)";
constexpr const char* k_calibrations = "SELECT count(*) FROM calibration_mission WHERE mission_key = ?1";
constexpr const char* k_mission_bin_put =
    "INSERT INTO mission_bin (mission_key, deleted_t_ns, deleted_ran_ns, deleted_by, emptying) "
    "VALUES (?1, ?2, ?3, ?4, 0)";
constexpr const char* k_mission_bin_find =
    "SELECT b.mission_key, b.emptying FROM mission_bin b JOIN mission m ON m.mission_key = b.mission_key "
    "WHERE m.id = ?1";
constexpr const char* k_restore = "DELETE FROM mission_bin WHERE mission_key = ?1";
constexpr const char* k_empty = "UPDATE mission_bin SET emptying = 1 WHERE mission_key = ?1";
constexpr const char* k_empty_before =
    "UPDATE mission_bin SET emptying = 1 WHERE emptying = 0 AND deleted_ran_ns < ?1 RETURNING mission_key";
constexpr const char* k_emptying =
    "SELECT b.mission_key, m.id FROM mission_bin b JOIN mission m ON m.mission_key = b.mission_key WHERE "
    "b.emptying = 1 ORDER BY b.mission_key LIMIT 1";
// Children first and few at a time; the impulse responses go with their ranges.
constexpr std::array k_mission_bin_rows{
    "DELETE FROM uwb_range WHERE range_id IN (SELECT range_id FROM uwb_range WHERE mission_key = ?1 LIMIT "
    "?2) "
    "RETURNING range_id",
    "DELETE FROM fix WHERE fix_id IN (SELECT fix_id FROM fix WHERE mission_key = ?1 LIMIT ?2) RETURNING "
    "fix_id"};
constexpr const char* k_mission_bin_remove = "DELETE FROM mission WHERE mission_key = ?1";

constexpr const char* k_running = "SELECT running_ns FROM service_state WHERE one = 1";
constexpr const char* k_keep_running =
    "UPDATE service_state SET running_ns = ?1 WHERE one = 1 AND running_ns < ?1";
constexpr const char* k_stream =
    "SELECT m.id FROM device_stream d JOIN mission m ON m.mission_key = d.mission_key ORDER BY d.position";
constexpr const char* k_drop_stream = "DELETE FROM device_stream";
constexpr const char* k_keep_stream =
    "INSERT INTO device_stream (position, mission_key) SELECT ?1, mission_key FROM mission WHERE id = ?2";

Error not_binned(const MissionId& id) {
  return make_error(Errc::not_found, "mission " + to_string(id) + " is not in the bin");
}

class SqlMissionBin final : public MissionBin {
 public:
  SqlMissionBin(Gate& gate, const CirFolder& files) : gate_(gate), files_(files) {}

  Result<void> put(const MissionId& id, UtcTime now, std::int64_t ran_ns, std::string_view by) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query found(c, k_mission_bin_state);
      found << id;
      if (!found.step()) return make_error(Errc::not_found, "no mission " + to_string(id));
      const std::int64_t key = found.integer();
      if (found.one_of(k_mission_state_words) == MissionState::recording)
        return make_error(Errc::conflict, "mission " + to_string(id) + " is recording: finish it first");
      Query used(c, k_calibrations);
      used << key;
      const std::int64_t n = used.step() ? used.integer() : 0;
      if (n > 0) {
        return make_error(Errc::conflict,
                          "mission " + to_string(id) + " is used by " + std::to_string(n) +
                              (n == 1 ? " calibration" : " calibrations") +
                              ", whose positions are based on its measurements: delete those first");
      }
      Query query(c, k_mission_bin_put);
      query << key << now << ran_ns << by;
      query.run();
      return std::nullopt;
    });
  }

  Result<void> restore(const MissionId& id) override {
    return write_void(gate_, [&](Connection& c) { return change(c, id, k_restore, false); });
  }
  Result<void> empty(const MissionId& id) override {
    return write_void(gate_, [&](Connection& c) { return change(c, id, k_empty, true); });
  }

  Result<BinnedMission> binned(const MissionId& id) override {
    return read_value<BinnedMission>(gate_, [&](Connection& c) -> Result<BinnedMission> {
      for (auto& one : read_binned_missions(c)) {
        if (one.mission.id == id) return std::move(one);
      }
      return not_binned(id);
    });
  }
  Result<std::vector<BinnedMission>> list() override {
    return read_value<std::vector<BinnedMission>>(
        gate_, [](Connection& c) -> Result<std::vector<BinnedMission>> { return read_binned_missions(c); });
  }

  Result<std::size_t> empty_before(std::int64_t ran_ns) override {
    return write_value<std::size_t>(gate_, 1, [&](Connection& c) -> Result<std::size_t> {
      Query query(c, k_empty_before);
      query << ran_ns;
      std::size_t n = 0;
      while (query.step()) ++n;
      return n;
    });
  }

  Result<std::size_t> remove_rows(std::size_t most) override {
    std::optional<MissionId> gone;
    const auto removed = write_value<std::size_t>(gate_, 1, [&](Connection& c) -> Result<std::size_t> {
      gone.reset();
      Query next(c, k_emptying);
      if (!next.step()) return std::size_t{0};
      const std::int64_t key = next.integer();
      const auto id = next.id<MissionId>();
      std::size_t n = 0;
      for (const char* text : k_mission_bin_rows) {
        if (n >= most) return n;
        Query query(c, text);
        query << key << row_limit(most - n);
        while (query.step()) ++n;
      }
      if (n >= most) return n;
      Query remove(c, k_mission_bin_remove);
      remove << key;
      remove.run();
      gone = id;
      return n + 1;
    });
    if (removed && gone) files_.remove_others(*gone, {});
    return removed;
  }

 private:
  static std::optional<Error> change(Connection& c, const MissionId& id, const char* text,
                                     bool also_while_emptying) {
    Query found(c, k_mission_bin_find);
    found << id;
    if (!found.step()) return not_binned(id);
    const std::int64_t key = found.integer();
    if (found.integer() != 0 && !also_while_emptying)
      return make_error(Errc::conflict, "mission " + to_string(id) + " is being removed permanently");
    Query query(c, text);
    query << key;
    query.run();
    return std::nullopt;
  }

  Gate& gate_;
  const CirFolder files_;
};

class SqlServiceStore final : public ServiceStore {
 public:
  explicit SqlServiceStore(Gate& gate) : gate_(gate) {}

  Result<std::int64_t> running_ns() override {
    return read_value<std::int64_t>(gate_, [](Connection& c) -> Result<std::int64_t> {
      Query query(c, k_running);
      return query.step() ? query.integer() : 0;
    });
  }
  Result<void> keep_running_ns(std::int64_t ns) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_keep_running);
      query << ns;
      query.run();
      return std::nullopt;
    });
  }
  Result<std::vector<MissionId>> device_stream() override {
    return read_value<std::vector<MissionId>>(gate_, [](Connection& c) -> Result<std::vector<MissionId>> {
      Query query(c, k_stream);
      std::vector<MissionId> out;
      while (query.step()) out.push_back(query.id<MissionId>());
      return out;
    });
  }
  Result<void> keep_device_stream(const std::vector<MissionId>& missions) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      c.execute(k_drop_stream);
      std::int64_t position = 0;
      for (const auto& id : missions) {
        Query query(c, k_keep_stream);
        query << ++position << id;
        query.run();
      }
      return std::nullopt;
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<MissionBin> make_mission_bin(Gate& gate, const CirFolder& files) {
  return std::make_unique<SqlMissionBin>(gate, files);
}
std::unique_ptr<ServiceStore> make_service_store(Gate& gate) {
  return std::make_unique<SqlServiceStore>(gate);
}

}  // namespace anchord::sql
