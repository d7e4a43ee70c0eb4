#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "core/ports/calibration_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "server/storage/sqlite_database.hpp"
#include "tests/scratch_dir.hpp"

namespace anchord {

constexpr UtcTime k_noon{1'777'889'472'345'678'000};

/// One database to run the contract on; a new backend adds a maker to backends() of backends.hpp.
struct Backend {
  std::string name;
  std::unique_ptr<Database> (*open)(const std::filesystem::path& dir);
  std::string (*missing)();  ///< empty, or why it cannot be tried here
  friend void PrintTo(const Backend& backend, std::ostream* out) { *out << backend.name; }
};

class StoreContract : public testing::TestWithParam<Backend> {
 protected:
  void SetUp() override {
    if (const std::string why = GetParam().missing(); !why.empty()) GTEST_SKIP() << why;
    reopen();
  }
  void reopen() {
    db_.reset();
    db_ = GetParam().open(dir_.path() / "data");
    ASSERT_NE(db_, nullptr);
  }
  Mission stored_mission(const std::string& name = "flight") {
    Mission m;
    m.id = MissionId{make_uuid_v7(k_noon)};
    m.name = name;
    m.created = k_noon;
    EXPECT_TRUE(db_->stores().missions.insert(m)) << db_->stores().missions.insert(m).error().message;
    return m;
  }
  Calibration stored_calibration(const Mission& mission, std::initializer_list<std::uint32_t> anchors) {
    Calibration c;
    c.id = CalibrationId{make_uuid_v7(k_noon)};
    c.missions = {mission.id};
    c.created = k_noon;
    for (const std::uint32_t id : anchors) {
      Estimate e;
      e.anchor = NetworkId{id};
      e.verdict = Verdict::ok;
      e.best = Hypothesis{};
      e.best->position.m.x() = id;
      c.anchors.push_back(e);
    }
    EXPECT_TRUE(db_->stores().calibrations.insert(c));
    return c;
  }

  ScratchDir dir_;
  std::unique_ptr<Database> db_;
};

inline Range range_at(const MissionId& mission, int i) {
  Range r;
  r.mission = mission;
  r.time = UtcTime{k_noon.ns + std::int64_t{i} * 10'000'000};
  r.tag = NetworkId{0x6e01};
  r.anchor = NetworkId{0x100u + static_cast<std::uint32_t>(i % 4)};
  r.seq = static_cast<std::uint64_t>(i);
  r.distance_m = 5.0 + 0.001 * i;
  return r;
}

inline Fix fix_at(const MissionId& mission, int i) {
  Fix f;
  f.mission = mission;
  f.time = UtcTime{k_noon.ns + std::int64_t{i} * 100'000'000};
  f.position = {51.0231234567891, 3.7131234567891, 58.412};
  f.fix = FixClass::rtk_fixed;
  return f;
}

}  // namespace anchord
