#include <algorithm>
#include <atomic>
#include <functional>
#include <limits>
#include <random>
#include <thread>

#include "core/ports/measurement_store.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::measurement_contract_test {
namespace {

using testing::Each;
using testing::ElementsAre;
using enum RowOutcome;
class MeasurementStoreContract : public StoreContract {
 protected:
  std::vector<RowOutcome> append(std::vector<Range> rows, bool atomic = false) {
    auto result = db_->stores().measurements.append_ranges(std::move(rows), atomic);
    EXPECT_TRUE(result) << result.error().message;
    return result ? result.value() : std::vector<RowOutcome>{};
  }
  std::vector<Range> all(const MissionId& mission) {
    MeasurementStore::Filter filter;
    filter.mission = mission;
    filter.limit = 100'000;
    filter.with_cir = true;
    return db_->stores().measurements.ranges(filter).value().rows;
  }
};

TEST_P(MeasurementStoreContract, GivesBackEveryFieldOfARange) {
  const auto mission = stored_mission();
  Range full = range_at(mission.id, 7);
  full.kind = RangeKind::anchor_anchor;
  full.received = UtcTime{full.time.ns + 5'000};
  full.antenna = 3;
  full.seq = 9'007'199'254'740'993;  // does not fit a double
  full.rss_dbm = -84.3;
  full.fp_dbm = -86.1;
  full.rx_dbm = -82.7;
  full.std_noise = 52;
  full.heading_deg = 120.5;
  full.truth = RangeTruth{7.35, true};
  full.cir = Cir{{1, -2, 32767, -32768}, 1001.6, 744.2, 1001};
  Range bare = range_at(mission.id, 8);
  bare.seq.reset();
  ASSERT_THAT(append({full, bare}), ElementsAre(accepted, accepted));
  const auto rows = all(mission.id);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].mission, mission.id);
  EXPECT_EQ(rows[0].kind, RangeKind::anchor_anchor);
  EXPECT_EQ(rows[0].time, full.time);
  EXPECT_EQ(rows[0].received, full.received);
  EXPECT_EQ(rows[0].tag, full.tag);
  EXPECT_EQ(rows[0].antenna, 3);
  EXPECT_EQ(rows[0].anchor, full.anchor);
  EXPECT_EQ(rows[0].seq, full.seq);
  EXPECT_EQ(rows[0].distance_m, full.distance_m);
  EXPECT_EQ(rows[0].rss_dbm, -84.3);
  EXPECT_EQ(rows[0].fp_dbm, -86.1);
  EXPECT_EQ(rows[0].rx_dbm, -82.7);
  EXPECT_EQ(rows[0].std_noise, 52);
  EXPECT_EQ(rows[0].heading_deg, 120.5);
  ASSERT_TRUE(rows[0].truth);
  EXPECT_EQ(rows[0].truth->distance_m, 7.35);
  EXPECT_EQ(rows[0].truth->los, true);
  ASSERT_TRUE(rows[0].cir);
  EXPECT_THAT(rows[0].cir->re_im, ElementsAre(1, -2, 32767, -32768));
  EXPECT_EQ(rows[0].cir->first_path_idx, 744.2);
  EXPECT_EQ(rows[0].cir->preamble_count, 1001);
  EXPECT_FALSE(rows[1].seq || rows[1].received || rows[1].rss_dbm || rows[1].truth || rows[1].cir);
}

TEST_P(MeasurementStoreContract, GivesBackEveryFieldOfAFix) {
  const auto mission = stored_mission();
  Fix globe = fix_at(mission.id, 0);
  globe.received = UtcTime{globe.time.ns + 1};
  globe.seq = 12;
  globe.covariance_m2 =
      (Eigen::Matrix3d() << 1e-4, 2e-5, 3e-6, 2e-5, 4e-4, 5e-6, 3e-6, 5e-6, 6e-4).finished();
  globe.enu_from_body = Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5);
  globe.correction_age_s = 0.8;
  globe.satellites = 21;
  Fix local = fix_at(mission.id, 1);
  local.frame = TrackFrame::local;
  local.local_m = {1.25, -2.5, 3.75};
  ASSERT_TRUE(db_->stores().measurements.append_fixes({globe, local}, false));
  MeasurementStore::Filter filter;
  filter.mission = mission.id;
  const auto rows = db_->stores().measurements.fixes(filter).value().rows;
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].position.lat_deg, 51.0231234567891);
  EXPECT_EQ(rows[0].position.lon_deg, 3.7131234567891);
  EXPECT_EQ(rows[0].position.height_m, 58.412);
  EXPECT_EQ(rows[0].received, globe.received);
  EXPECT_EQ(rows[0].seq, 12u);
  EXPECT_EQ(rows[0].fix, FixClass::rtk_fixed);
  EXPECT_EQ(*rows[0].covariance_m2, *globe.covariance_m2);
  EXPECT_EQ(rows[0].enu_from_body->coeffs(), globe.enu_from_body->coeffs());
  EXPECT_EQ(rows[0].correction_age_s, 0.8);
  EXPECT_EQ(rows[0].satellites, 21);
  EXPECT_EQ(rows[1].frame, TrackFrame::local);
  EXPECT_EQ(rows[1].local_m, local.local_m);
  EXPECT_FALSE(rows[1].covariance_m2 || rows[1].enu_from_body || rows[1].satellites);
}

TEST_P(MeasurementStoreContract, CountsTheSameRowAgainAsDuplicateWhateverItsArrivalTime) {
  const auto mission = stored_mission();
  Range row = range_at(mission.id, 1);
  row.cir = Cir{{1, 2}, 1001.6, std::nullopt, std::nullopt};
  append({row});
  row.received = k_noon;
  EXPECT_THAT(append({row, row}), ElementsAre(duplicate, duplicate));
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission.id).value(), 1u);
}

TEST_P(MeasurementStoreContract, KeepsTheStoredRowWhenTheSameIdentityComesWithOtherContent) {
  const auto mission = stored_mission();
  Range row = range_at(mission.id, 1);
  append({row});
  Range other = row;
  other.distance_m += 1;
  Range other_cir = row;
  other_cir.cir = Cir{{1, 2}, 1001.6, std::nullopt, std::nullopt};
  EXPECT_THAT(append({other, other_cir}), ElementsAre(conflict, conflict));
  EXPECT_EQ(all(mission.id).at(0).distance_m, row.distance_m);
}

TEST_P(MeasurementStoreContract, TellsRowsApartByEveryPartOfTheIdentity) {
  const auto mission = stored_mission();
  const auto second_mission = stored_mission("second");
  const Range row = range_at(mission.id, 1);
  std::vector<Range> rows(7, row);
  rows[1].mission = second_mission.id;
  rows[2].tag = NetworkId{1};
  rows[3].antenna = 1;
  rows[4].anchor = NetworkId{2};
  rows[5].time.ns += 1;
  rows[6].seq.reset();
  EXPECT_THAT(append(rows), Each(accepted));
  EXPECT_THAT(append(rows), Each(duplicate));
}

TEST_P(MeasurementStoreContract, NamesRowsOfUnknownMissionsAndStoresTheOthers) {
  const auto mission = stored_mission();
  const MissionId stranger{make_uuid_v7(k_noon)};
  EXPECT_THAT(append({range_at(mission.id, 1), range_at(stranger, 2), range_at(mission.id, 3)}),
              ElementsAre(accepted, unknown_mission, accepted));
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission.id).value(), 2u);
}

TEST_P(MeasurementStoreContract, StoresNothingOfAnAtomicCallWithOneBadRow) {
  const auto mission = stored_mission();
  append({range_at(mission.id, 1)});
  Range bad = range_at(mission.id, 1);
  bad.distance_m = 99;
  EXPECT_THAT(append({range_at(mission.id, 2), bad}, true), ElementsAre(accepted, conflict));
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission.id).value(), 1u);
  EXPECT_THAT(append({range_at(mission.id, 1), range_at(mission.id, 2)}, true),
              ElementsAre(duplicate, accepted));
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission.id).value(), 2u);
}

TEST_P(MeasurementStoreContract, TakesAnEmptyCall) { EXPECT_TRUE(append({}).empty()); }

TEST_P(MeasurementStoreContract, RefusesWhatIsNotANumber) {
  const auto mission = stored_mission();
  Range bad = range_at(mission.id, 1);
  bad.distance_m = std::numeric_limits<double>::quiet_NaN();
  const auto result = db_->stores().measurements.append_ranges({range_at(mission.id, 0), bad}, false);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::invalid_argument);
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission.id).value(), 0u);
}

TEST_P(MeasurementStoreContract, PagesThroughAllRowsOnceInBothDirections) {
  const auto mission = stored_mission();
  std::vector<Range> rows;
  for (int i = 0; i < 23; ++i) {
    rows.push_back(range_at(mission.id, i));
    rows.back().time = UtcTime{k_noon.ns + (i / 5) * 1'000'000};  // five of the same instant
  }
  std::ranges::reverse(rows);  // arrival out of order
  append(rows);
  for (const bool descending : {false, true}) {
    for (const bool of_mission : {false, true}) {
      MeasurementStore::Filter filter;
      if (of_mission) filter.mission = mission.id;
      filter.limit = 4;
      filter.descending = descending;
      std::vector<std::int64_t> ids;
      std::vector<std::int64_t> times;
      do {
        const auto page = db_->stores().measurements.ranges(filter).value();
        ASSERT_LE(page.rows.size(), 4u);
        for (const Range& row : page.rows) times.push_back(row.time.ns);
        ids.insert(ids.end(), page.ids.begin(), page.ids.end());
        filter.after = page.next;
      } while (!filter.after.empty());
      EXPECT_EQ(ids.size(), 23u);
      EXPECT_TRUE(descending ? std::ranges::is_sorted(times, std::greater{}) : std::ranges::is_sorted(times));
      std::ranges::sort(ids);
      EXPECT_EQ(std::ranges::adjacent_find(ids), ids.end());
    }
  }
}

TEST_P(MeasurementStoreContract, FiltersByAnchorTagAndHalfOpenTime) {
  const auto mission = stored_mission();
  std::vector<Range> rows;
  for (int i = 0; i < 12; ++i) rows.push_back(range_at(mission.id, i));
  rows[5].tag = NetworkId{77};
  append(rows);
  MeasurementStore::Filter filter;
  filter.mission = mission.id;
  filter.anchor = NetworkId{0x101};
  EXPECT_EQ(db_->stores().measurements.ranges(filter).value().rows.size(), 3u);  // 1, 5, 9
  filter.tag = NetworkId{77};
  EXPECT_EQ(db_->stores().measurements.ranges(filter).value().rows.size(), 1u);
  filter.anchor.reset();
  filter.tag.reset();
  filter.since = rows[2].time;
  filter.until = rows[4].time;
  EXPECT_EQ(db_->stores().measurements.ranges(filter).value().rows.size(), 2u);  // 2, 3
}

TEST_P(MeasurementStoreContract, FiltersByDistanceLevelAndLabelAndCountsTheSameRows) {
  const auto mission = stored_mission();
  std::vector<Range> rows;
  for (int i = 0; i < 10; ++i) {
    rows.push_back(range_at(mission.id, i));
    rows.back().distance_m = i;
    rows.back().rx_dbm.reset();
    rows.back().rss_dbm.reset();
    rows.back().truth.reset();
  }
  rows[2].rx_dbm = -80;
  rows[3].rss_dbm = -80;  // stands in where there is no RX power
  rows[4].rx_dbm = -90, rows[4].rss_dbm = -80;
  rows[5].truth = RangeTruth{std::nullopt, true};
  rows[6].truth = RangeTruth{6.0, false};
  rows[7].truth = RangeTruth{7.0, std::nullopt};
  append(rows);
  const auto found = [&](const MeasurementLimits& limits) {
    MeasurementStore::Filter filter;
    filter.mission = mission.id;
    filter.limits = limits;
    std::vector<int> out;
    for (const auto page = db_->stores().measurements.ranges(filter); const auto& row : page.value().rows)
      out.push_back(static_cast<int>(row.distance_m));
    EXPECT_EQ(db_->stores().measurements.count_ranges(filter).value(), out.size());
    return out;
  };
  using Label = MeasurementLimits::Label;
  EXPECT_THAT(found({3.0, 5.0, {}, {}, {}}), ElementsAre(3, 4, 5));
  EXPECT_THAT(found({{}, {}, -85.0, -70.0, {}}), ElementsAre(2, 3));
  EXPECT_THAT(found({{}, {}, {}, -85.0, {}}), ElementsAre(4)) << "what has no level passes no limit on it";
  EXPECT_THAT(found({{}, {}, {}, {}, Label::los}), ElementsAre(5));
  EXPECT_THAT(found({{}, {}, {}, {}, Label::nlos}), ElementsAre(6));
  EXPECT_THAT(found({{}, {}, {}, {}, Label::none}), ElementsAre(0, 1, 2, 3, 4, 7, 8, 9));
}

TEST_P(MeasurementStoreContract, FiltersByTheFixThatHeldWhenARangeWasTaken) {
  const auto mission = stored_mission();
  std::vector<Range> rows;
  for (int i = 0; i < 4; ++i) rows.push_back(range_at(mission.id, i));
  rows[0].time = UtcTime{k_noon.ns - 1};              // before the first position
  rows[1].time = k_noon;                              // with it
  rows[2].time = UtcTime{k_noon.ns + 1'500'000'000};  // after the second
  rows[3].time = UtcTime{k_noon.ns + 3'000'000'001};  // more than 2 s after the last
  append(rows);
  auto first = fix_at(mission.id, 0), second = fix_at(mission.id, 1);
  first.time = k_noon, first.fix = FixClass::rtk_float;
  second.time = UtcTime{k_noon.ns + 1'000'000'000}, second.fix = FixClass::rtk_fixed;
  ASSERT_TRUE(db_->stores().measurements.append_fixes({first, second}, true));
  const auto times = [&](FixClass fix) {
    MeasurementStore::Filter filter;
    filter.mission = mission.id;
    filter.fix = fix;
    std::vector<std::int64_t> out;
    for (const auto page = db_->stores().measurements.ranges(filter); const auto& row : page.value().rows)
      out.push_back(row.time.ns);
    return out;
  };
  EXPECT_THAT(times(FixClass::rtk_float), ElementsAre(rows[1].time.ns));
  EXPECT_THAT(times(FixClass::rtk_fixed), ElementsAre(rows[2].time.ns));
  EXPECT_THAT(times(FixClass::none), ElementsAre(rows[0].time.ns, rows[3].time.ns));
}

// Positions at one time, gaps of more than 2 s, ranges at the very time of a position: what holds is said by
// the definition, row by row; pages are as a reader takes them.
TEST_P(MeasurementStoreContract, PagesTheRangesOfAClassOfPositionInOrderBothWays) {
  const auto mission = stored_mission();
  std::mt19937 random(11);
  std::vector<Fix> fixes;
  for (std::int64_t t_ns = 0, i = 0; i < 120;
       ++i, t_ns += 500'000'000 * static_cast<std::int64_t>(random() % 7)) {
    fixes.push_back(fix_at(mission.id, 0));
    fixes.back().time = UtcTime{k_noon.ns + t_ns};
    fixes.back().seq = static_cast<std::uint64_t>(i);
    fixes.back().fix = random() % 3 == 0 ? FixClass::rtk_float : FixClass::rtk_fixed;
  }
  ASSERT_TRUE(db_->stores().measurements.append_fixes(fixes, true));
  std::vector<Range> rows;
  std::vector<std::int64_t> expected;
  for (int i = 0; i < 900; ++i) {
    rows.push_back(range_at(mission.id, i));
    rows.back().time = UtcTime{k_noon.ns - 1'000'000'000 + 250'000'000 * std::int64_t{i}};
    const Fix* held = nullptr;  // the newest, and of those of one time the last by number
    for (const auto& fix : fixes) {
      if (!(rows.back().time < fix.time) && rows.back().time.ns - fix.time.ns <= 2'000'000'000) held = &fix;
    }
    if (held != nullptr && held->fix == FixClass::rtk_float) expected.push_back(rows.back().time.ns);
  }
  append(rows);
  ASSERT_GT(expected.size(), 20u);
  MeasurementStore::Filter filter;
  filter.mission = mission.id;
  filter.fix = FixClass::rtk_float;
  EXPECT_EQ(db_->stores().measurements.count_ranges(filter).value(), expected.size());
  filter.limit = 7;
  for (const bool descending : {false, true}) {
    filter.descending = descending;
    filter.after.clear();
    std::vector<std::int64_t> found;
    do {
      const auto page = db_->stores().measurements.ranges(filter).value();
      for (const auto& row : page.rows) found.push_back(row.time.ns);
      filter.after = page.next;
    } while (!filter.after.empty());
    EXPECT_EQ(found, expected);
    std::ranges::reverse(expected);
  }
}

TEST_P(MeasurementStoreContract, CountsFixesThatWereAcceptedAndNoRepetition) {
  const auto mission = stored_mission(), other = stored_mission("other");
  auto& measurements = db_->stores().measurements;
  ASSERT_TRUE(
      measurements.append_fixes({fix_at(mission.id, 0), fix_at(other.id, 0), fix_at(mission.id, 1)}, false));
  ASSERT_TRUE(measurements.append_fixes({fix_at(mission.id, 1), fix_at(mission.id, 2)}, false));
  auto changed = fix_at(mission.id, 2);
  changed.position.height_m += 1;
  ASSERT_TRUE(measurements.append_fixes({fix_at(mission.id, 3), changed}, true));  // a conflict: none of them
  EXPECT_EQ(measurements.count_fixes(mission.id).value(), 3u);
  EXPECT_EQ(measurements.count_fixes(other.id).value(), 1u);
  reopen();
  EXPECT_EQ(db_->stores().measurements.count_fixes(mission.id).value(), 3u);
}

TEST_P(MeasurementStoreContract, ThinsEvenlyOverAllPagesAndOutOfStepWithRadiosThatTalkInTurn) {
  const auto mission = stored_mission();
  std::vector<Range> rows;
  for (int i = 0; i < 4000; ++i) rows.push_back(range_at(mission.id, i));  // four anchors in turn
  append(rows);
  MeasurementStore::Filter filter;
  filter.mission = mission.id;
  filter.every = 4;
  const auto found = [&](std::size_t limit) {
    filter.limit = limit;
    std::vector<std::int64_t> ids;
    do {
      const auto page = db_->stores().measurements.ranges(filter).value();
      ids.insert(ids.end(), page.ids.begin(), page.ids.end());
      filter.after = page.next;
    } while (!filter.after.empty());
    return ids;
  };
  const auto ids = found(10'000);
  EXPECT_NEAR(static_cast<double>(ids.size()), 1000,
              110);  // four sigma of a fair draw: sqrt(4000 x 1/4 x 3/4) = 27
  EXPECT_EQ(found(77), ids) << "the same ones, whatever the page";
  for (const std::uint32_t anchor : {0x100u, 0x101u, 0x102u, 0x103u}) {
    filter.anchor = NetworkId{anchor};
    EXPECT_NEAR(static_cast<double>(found(10'000).size()), 250, 56) << anchor;
  }
  EXPECT_EQ(db_->stores().measurements.count_ranges(filter).value(), 1000u) << "a count is of all";
}

TEST_P(MeasurementStoreContract, RefusesACursorThatIsNotItsOwn) {
  for (const char* cursor : {"x", "1", "1.", "1.2x", "99999999999999999999.1"}) {
    MeasurementStore::Filter filter;
    filter.after = cursor;
    const auto page = db_->stores().measurements.ranges(filter);
    ASSERT_FALSE(page) << cursor;
    EXPECT_EQ(page.error().code, Errc::invalid_argument);
  }
}

TEST_P(MeasurementStoreContract, FindsOneRangeByTheIdOfItsPage) {
  const auto mission = stored_mission();
  Range row = range_at(mission.id, 3);
  row.cir = Cir{{5, 6}, 1001.6, std::nullopt, std::nullopt};
  append({row});
  const auto page = db_->stores().measurements.ranges({}).value();
  ASSERT_EQ(page.ids.size(), 1u);
  EXPECT_FALSE(page.rows[0].cir) << "lists leave impulse responses out unless asked";
  const auto found = db_->stores().measurements.range(page.ids[0]).value();
  EXPECT_EQ(found.mission, mission.id);
  EXPECT_TRUE(found.cir);
  EXPECT_EQ(db_->stores().measurements.range(page.ids[0] + 1).error().code, Errc::not_found);
}

TEST_P(MeasurementStoreContract, KnowsEveryRadioItHeard) {
  const auto mission = stored_mission();
  append({range_at(mission.id, 0), range_at(mission.id, 4), range_at(mission.id, 1)});
  append({range_at(mission.id, 0)});  // a duplicate is not another range
  const auto devices = db_->stores().measurements.devices(mission.id).value();
  ASSERT_EQ(devices.size(), 3u);
  for (const DeviceSeen& device : devices) {
    const bool is_tag = device.kind == DeviceSeen::Kind::tag;
    EXPECT_EQ(device.network_id, is_tag ? NetworkId{0x6e01} : device.network_id);
    const std::uint64_t expected = is_tag ? 3 : device.network_id == NetworkId{0x100} ? 2 : 1;
    EXPECT_EQ(device.n_ranges, expected);
  }
  EXPECT_EQ(devices[0].last_seen, range_at(mission.id, 4).time);
  EXPECT_EQ(db_->stores().measurements.devices(std::nullopt).value().size(), 3u);
}

TEST_P(MeasurementStoreContract, KeepsEverythingOverAReopening) {
  const auto mission = stored_mission();
  append({range_at(mission.id, 0), range_at(mission.id, 1)});
  reopen();
  EXPECT_EQ(all(mission.id).size(), 2u);
  EXPECT_THAT(append({range_at(mission.id, 0)}), ElementsAre(duplicate));
}

TEST_P(MeasurementStoreContract, TakesEveryRowOnceFromManyThreadsAtOnce) {
  const auto mission = stored_mission();
  std::atomic<int> n_accepted{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int batch = 0; batch < 20; ++batch) {
        std::vector<Range> rows;
        for (int i = 0; i < 10; ++i) rows.push_back(range_at(mission.id, batch * 10 + i));
        const auto outcomes = append(std::move(rows), batch % 2 == 0);
        n_accepted += static_cast<int>(std::ranges::count(outcomes, accepted));
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(n_accepted, 200);
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission.id).value(), 200u);
  MeasurementStore::Filter all;
  all.mission = mission.id;
  EXPECT_EQ(db_->stores().measurements.count_ranges(all).value(), 200u) << "row by row";
}

INSTANTIATE_TEST_SUITE_P(Backends, MeasurementStoreContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::measurement_contract_test
