// Missions and their rows.
#include <map>

#include "api/scope/scoped.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord::api {
namespace {

class ScopedMissions final : public MissionStore {
 public:
  explicit ScopedMissions(MissionStore& all) : all_(all) {}
  Result<void> insert(const Mission& mission) override {
    if (!current_sites().holds(mission.site)) return elsewhere("/site of the mission");
    return all_.insert(mission);
  }
  Result<void> update(const Mission& mission) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->mission(mission.id));
      if (!current_sites().holds(mission.site)) return elsewhere("/site of the mission");
    }
    return all_.update(mission);
  }
  Result<Mission> finish(const MissionId& id, UtcTime now) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(mission(id));
    }
    return all_.finish(id, now);
  }
  Result<Mission> mission(const MissionId& id) override {
    auto found = all_.mission(id);
    if (found && !current_sites().holds(found.value().site)) return absent("mission", id);
    return found;
  }
  Result<std::vector<Mission>> missions(std::size_t limit, const std::optional<MissionId>& after) override {
    return seen_page<Mission>(
        limit, after, [&](auto n, const auto& from) { return all_.missions(n, from); },
        [](const Mission& mission) -> Result<bool> { return current_sites().holds(mission.site); },
        [](const Mission& mission) { return mission.id; });
  }

 private:
  MissionStore& all_;
};

class ScopedBin final : public MissionBin {
 public:
  explicit ScopedBin(MissionBin& all) : all_(all) {}
  Result<void> put(const MissionId& id, UtcTime now, std::int64_t ran_ns, std::string_view by) override {
    return all_.put(id, now, ran_ns, by);  // by who read the mission
  }
  Result<void> restore(const MissionId& id) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(binned(id));
    }
    return all_.restore(id);
  }
  Result<BinnedMission> binned(const MissionId& id) override {
    auto found = all_.binned(id);
    if (found && !current_sites().holds(found.value().mission.site))
      return make_error(Errc::not_found, "mission " + to_string(id) + " is not in the bin");
    return found;
  }
  Result<std::vector<BinnedMission>> list() override {
    BOOST_OUTCOME_TRY(auto all, all_.list());
    std::erase_if(all, [](const auto& one) { return !current_sites().holds(one.mission.site); });
    return all;
  }
  Result<void> empty(const MissionId& id) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(binned(id));
    }
    return all_.empty(id);
  }
  Result<std::size_t> empty_before(std::int64_t ran_ns) override { return all_.empty_before(ran_ns); }
  Result<std::size_t> remove_rows(std::size_t most) override { return all_.remove_rows(most); }

 private:
  MissionBin& all_;
};

/// Rows are of missions: one that is seen is named, or none are.
class ScopedMeasurements final : public MeasurementStore {
 public:
  ScopedMeasurements(MeasurementStore& all, MissionStore& missions) : all_(all), missions_(missions) {}
  Result<std::vector<RowOutcome>> append_ranges(std::vector<Range> rows, bool atomic) override {
    BOOST_OUTCOME_TRYV(all_seen(rows));
    return all_.append_ranges(std::move(rows), atomic);
  }
  Result<std::vector<RowOutcome>> append_fixes(std::vector<Fix> rows, bool atomic) override {
    BOOST_OUTCOME_TRYV(all_seen(rows));
    return all_.append_fixes(std::move(rows), atomic);
  }
  Result<Page<Range>> ranges(const Filter& filter) override {
    BOOST_OUTCOME_TRYV(seen(filter.mission));
    return all_.ranges(filter);
  }
  Result<Page<Fix>> fixes(const Filter& filter) override {
    BOOST_OUTCOME_TRYV(seen(filter.mission));
    return all_.fixes(filter);
  }
  Result<Range> range(std::int64_t id) override {
    auto found = all_.range(id);
    if (!found || current_sites().all()) return found;
    BOOST_OUTCOME_TRY(const bool there, is_there(missions_.mission(found.value().mission)));
    if (!there) return make_error(Errc::not_found, "no range " + std::to_string(id));
    return found;
  }
  Result<std::uint64_t> count_ranges(const MissionId& mission) override {
    BOOST_OUTCOME_TRYV(seen(mission));
    return all_.count_ranges(mission);
  }
  Result<std::uint64_t> count_ranges(const Filter& filter) override {
    BOOST_OUTCOME_TRYV(seen(filter.mission));
    return all_.count_ranges(filter);
  }
  Result<std::uint64_t> count_fixes(const MissionId& mission) override {
    BOOST_OUTCOME_TRYV(seen(mission));
    return all_.count_fixes(mission);
  }
  Result<std::vector<DeviceSeen>> devices(const std::optional<MissionId>& mission) override {
    if (mission) {
      BOOST_OUTCOME_TRYV(seen(mission));
      return all_.devices(mission);
    }
    BOOST_OUTCOME_TRY(auto radios, all_.devices(mission));
    std::map<MissionId, bool> known;
    for (const auto& radio : radios) {
      if (const auto [at, fresh] = known.try_emplace(radio.mission, true); fresh && !current_sites().all()) {
        BOOST_OUTCOME_TRY(at->second, is_there(missions_.mission(radio.mission)));
      }
    }
    std::erase_if(radios, [&](const DeviceSeen& radio) { return !known.at(radio.mission); });
    return radios;
  }

 private:
  Result<void> seen(const std::optional<MissionId>& mission) {
    if (current_sites().all()) return boost::outcome_v2::success();
    if (!mission)
      return make_error(Errc::invalid_argument, "this token is bound to sites: name a mission of theirs");
    BOOST_OUTCOME_TRY(const bool there, is_there(missions_.mission(*mission)));
    if (there) return boost::outcome_v2::success();
    return make_error(Errc::not_found,
                      "no mission " + to_string(*mission) + ": it was deleted, or never was here");
  }
  template <class Row>
  Result<void> all_seen(const std::vector<Row>& rows) {
    if (current_sites().all()) return boost::outcome_v2::success();
    std::optional<MissionId> last;
    for (const auto& row : rows) {
      if (row.mission == last) continue;
      BOOST_OUTCOME_TRYV(seen(row.mission));
      last = row.mission;
    }
    return boost::outcome_v2::success();
  }
  MeasurementStore& all_;
  MissionStore& missions_;
};

}  // namespace

std::unique_ptr<MissionStore> scoped_missions(MissionStore& all) {
  return std::make_unique<ScopedMissions>(all);
}
std::unique_ptr<MissionBin> scoped_bin(MissionBin& all) { return std::make_unique<ScopedBin>(all); }
std::unique_ptr<MeasurementStore> scoped_measurements(MeasurementStore& all, MissionStore& missions) {
  return std::make_unique<ScopedMeasurements>(all, missions);
}

}  // namespace anchord::api
