#include <cmath>
#include <limits>

#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/kit_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::catalogue_contract_test {
namespace {

class MissionStoreContract : public StoreContract {};

TEST_P(MissionStoreContract, GivesBackEveryField) {
  Site site;
  site.id = SiteId{make_uuid_v7(k_noon)};
  ASSERT_TRUE(db_->stores().sites.insert(site));
  Mission m;
  m.id = MissionId{make_uuid_v7(k_noon)};
  m.site = site.id;
  m.name = "Halle \xC3\xA4, \"A'; DROP TABLE mission";
  m.kit = "kit";
  m.radio = "dw1000";
  m.frame = TrackFrame::local;
  m.point = TrackPoint::body;
  m.state = MissionState::finished;
  m.created = k_noon;
  m.finished = UtcTime{k_noon.ns + 1};
  m.tags = {{NetworkId{0x6e01}, 0, {0.1, -0.2, -0.3}}, {NetworkId{0xffffffff}, 255, {0, 0, 0}}};
  m.lever_arm_sigma_m = 0.1 / 3;
  ASSERT_TRUE(db_->stores().missions.insert(m));
  const auto found = db_->stores().missions.mission(m.id).value();
  EXPECT_EQ(found.site, m.site);
  EXPECT_EQ(found.name, m.name);
  EXPECT_EQ(found.kit, "kit");
  EXPECT_EQ(found.radio, "dw1000");
  EXPECT_EQ(found.frame, TrackFrame::local);
  EXPECT_EQ(found.point, TrackPoint::body);
  EXPECT_EQ(found.state, MissionState::finished);
  EXPECT_EQ(found.created, k_noon);
  EXPECT_EQ(found.finished, m.finished);
  ASSERT_EQ(found.tags.size(), 2u);
  EXPECT_EQ(found.tags[0].lever_arm_body_m, Eigen::Vector3d(0.1, -0.2, -0.3));
  EXPECT_EQ(found.tags[1].tag, NetworkId{0xffffffff});
  EXPECT_EQ(found.tags[1].antenna, 255);
  EXPECT_EQ(found.lever_arm_sigma_m, 0.1 / 3);
}

TEST_P(MissionStoreContract, UpdatesAllOfAMissionAndNamesAnUnknownOne) {
  Mission m = stored_mission();
  EXPECT_EQ(db_->stores().missions.mission(m.id).value().lever_arm_sigma_m, std::nullopt);
  m.name = "other";
  m.tags = {{NetworkId{9}, 1, {1, 2, 3}}};
  m.lever_arm_sigma_m = 0.05;
  m.state = MissionState::finished;
  ASSERT_TRUE(db_->stores().missions.update(m));
  const auto found = db_->stores().missions.mission(m.id).value();
  EXPECT_EQ(found.name, "other");
  EXPECT_EQ(found.tags.size(), 1u);
  EXPECT_EQ(found.lever_arm_sigma_m, 0.05);
  m.lever_arm_sigma_m.reset();
  ASSERT_TRUE(db_->stores().missions.update(m));
  EXPECT_EQ(db_->stores().missions.mission(m.id).value().lever_arm_sigma_m, std::nullopt);
  m.id = MissionId{make_uuid_v7(k_noon)};
  EXPECT_EQ(db_->stores().missions.update(m).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().missions.mission(m.id).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().bin.put(m.id, k_noon, 0, "me").error().code, Errc::not_found);
}

TEST_P(MissionStoreContract, RefusesTheSameIdTwiceAndASiteThatIsNotThere) {
  Mission m = stored_mission();
  EXPECT_EQ(db_->stores().missions.insert(m).error().code, Errc::conflict);
  m.id = MissionId{make_uuid_v7(k_noon)};
  m.site = SiteId{make_uuid_v7(k_noon)};
  EXPECT_EQ(db_->stores().missions.insert(m).error().code, Errc::not_found);
}

TEST_P(MissionStoreContract, ListsNewestFirstPageByPage) {
  std::vector<MissionId> ids;
  for (int i = 0; i < 5; ++i) {
    Mission m;
    m.id = MissionId{make_uuid_v7(UtcTime{k_noon.ns + i * 1'000'000'000LL})};
    ASSERT_TRUE(db_->stores().missions.insert(m));
    ids.push_back(m.id);
  }
  const auto first = db_->stores().missions.missions(2, std::nullopt).value();
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].id, ids[4]);
  const auto next = db_->stores().missions.missions(10, first[1].id).value();
  ASSERT_EQ(next.size(), 3u);
  EXPECT_EQ(next[2].id, ids[0]);
}

TEST_P(MissionStoreContract, ListsByInsertionAlsoWhenTheClockWasSetBack) {
  Mission ahead, after;
  ahead.id = MissionId{make_uuid_v7(UtcTime{k_noon.ns + 300LL * 86'400 * 1'000'000'000})};
  after.id = MissionId{make_uuid_v7(k_noon)};
  ASSERT_TRUE(db_->stores().missions.insert(ahead));
  ASSERT_TRUE(db_->stores().missions.insert(after));
  EXPECT_EQ(db_->stores().missions.missions(1, std::nullopt).value()[0].id, after.id);
  EXPECT_EQ(db_->stores().missions.missions(1, after.id).value()[0].id, ahead.id);
}

MeasurementStore::Filter of(const MissionId& mission) {
  MeasurementStore::Filter filter;
  filter.mission = mission;
  return filter;
}

TEST_P(MissionStoreContract, HidesWhatIsInTheBinAndGivesItBackWhole) {
  auto m = stored_mission();
  const auto other = stored_mission();
  m.state = MissionState::finished;
  ASSERT_TRUE(db_->stores().missions.update(m));
  ASSERT_TRUE(db_->stores().measurements.append_ranges({range_at(m.id, 1), range_at(other.id, 1)}, false));
  ASSERT_TRUE(db_->stores().measurements.append_fixes({fix_at(m.id, 1)}, false));
  const auto id = db_->stores().measurements.ranges(of(m.id)).value().ids.at(0);
  EXPECT_EQ(db_->stores().bin.restore(m.id).error().code, Errc::not_found) << "it is not in there";
  ASSERT_TRUE(db_->stores().bin.put(m.id, k_noon, 7, "me"));
  EXPECT_EQ(db_->stores().bin.put(m.id, k_noon, 7, "me").error().code, Errc::not_found) << "twice";
  EXPECT_EQ(db_->stores().missions.mission(m.id).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().missions.update(m).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().missions.insert(m).error().code, Errc::conflict) << "its id is taken";
  EXPECT_EQ(db_->stores().missions.missions(10, std::nullopt).value().size(), 1u);
  EXPECT_EQ(db_->stores().measurements.ranges({}).value().rows.size(), 1u) << "no query finds its rows";
  EXPECT_EQ(db_->stores().measurements.ranges(of(m.id)).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().measurements.fixes(of(m.id)).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().measurements.count_ranges(of(m.id)).error().code, Errc::not_found);
  EXPECT_TRUE(db_->stores().measurements.fixes({}).value().rows.empty());
  EXPECT_EQ(db_->stores().measurements.range(id).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().measurements.count_ranges(MeasurementStore::Filter{}).value(), 1u);
  EXPECT_EQ(db_->stores().measurements.devices(m.id).value().size(), 0u);
  EXPECT_EQ(db_->stores().measurements.append_ranges({range_at(m.id, 2)}, false).value()[0],
            RowOutcome::unknown_mission);
  const auto list = db_->stores().bin.list().value();
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0].mission.name, m.name);
  EXPECT_EQ(list[0].deleted_by, "me");
  EXPECT_EQ(list[0].deleted_ran_ns, 7);
  EXPECT_EQ(list[0].n_ranges, 1u);
  EXPECT_EQ(list[0].n_fixes, 1u);
  ASSERT_TRUE(db_->stores().bin.restore(m.id));
  EXPECT_EQ(db_->stores().missions.mission(m.id).value().state, MissionState::finished);
  EXPECT_EQ(db_->stores().measurements.ranges(of(m.id)).value().rows.size(), 1u);
  EXPECT_TRUE(db_->stores().bin.list().value().empty());
}

TEST_P(MissionStoreContract, NeverGivesTheRestOfAFlightDeletedBetweenTwoPages) {
  auto m = stored_mission();
  m.state = MissionState::finished;
  ASSERT_TRUE(db_->stores().missions.update(m));
  ASSERT_TRUE(
      db_->stores()
          .measurements.append_ranges({range_at(m.id, 1), range_at(m.id, 2), range_at(m.id, 3)}, false)
          .has_value());
  auto filter = of(m.id);
  filter.limit = 2;
  const auto page = db_->stores().measurements.ranges(filter).value();
  ASSERT_EQ(page.rows.size(), 2u);
  filter.after = page.next;
  ASSERT_TRUE(db_->stores().bin.put(m.id, k_noon, 0, "me"));
  EXPECT_EQ(db_->stores().measurements.ranges(filter).error().code, Errc::not_found) << "in the bin";
  ASSERT_TRUE(db_->stores().bin.empty(m.id));
  while (db_->stores().bin.remove_rows(1).value() > 0) {
  }
  EXPECT_EQ(db_->stores().measurements.ranges(filter).error().code, Errc::not_found) << "gone";
}

TEST_P(MissionStoreContract, PutsNothingIntoTheBinThatRecordsOrACalibrationStandsOn) {
  auto recording = stored_mission();
  recording.state = MissionState::recording;
  ASSERT_TRUE(db_->stores().missions.update(recording));
  EXPECT_EQ(db_->stores().bin.put(recording.id, k_noon, 0, "me").error().code, Errc::conflict);
  auto used = stored_mission();
  used.state = MissionState::finished;
  ASSERT_TRUE(db_->stores().missions.update(used));
  ASSERT_TRUE(db_->stores().measurements.append_ranges({range_at(used.id, 1)}, false));
  stored_calibration(used, {1});
  const auto refused = db_->stores().bin.put(used.id, k_noon, 0, "me");
  EXPECT_EQ(refused.error().code, Errc::conflict);
  EXPECT_NE(refused.error().message.find("1 calibration"), std::string::npos) << refused.error().message;
}

TEST_P(MissionStoreContract, EmptiesTheBinByRunningTimeASliceAtATime) {
  auto old = stored_mission(), young = stored_mission();
  for (auto* m : {&old, &young}) {
    m->state = MissionState::finished;
    ASSERT_TRUE(db_->stores().missions.update(*m));
    std::vector<Range> rows;
    for (int i = 1; i <= 10; ++i) {
      rows.push_back(range_at(m->id, i));
      rows.back().cir = Cir{};
    }
    ASSERT_TRUE(db_->stores().measurements.append_ranges(rows, false));
    ASSERT_TRUE(db_->stores().measurements.append_fixes({fix_at(m->id, 1)}, false));
  }
  ASSERT_TRUE(db_->stores().bin.put(old.id, k_noon, 100, "me"));
  ASSERT_TRUE(db_->stores().bin.put(young.id, k_noon, 200, "me"));
  EXPECT_EQ(db_->stores().bin.remove_rows(5).value(), 0u) << "nothing is due";
  EXPECT_EQ(db_->stores().bin.empty_before(200).value(), 1u);
  EXPECT_EQ(db_->stores().bin.restore(old.id).error().code, Errc::conflict) << "too late";
  EXPECT_TRUE(db_->stores().bin.binned(old.id).value().emptying);
  EXPECT_EQ(db_->stores().bin.remove_rows(6).value(), 6u);
  EXPECT_EQ(db_->stores().bin.remove_rows(6).value(), 6u) << "four ranges, the fix and the mission";
  EXPECT_EQ(db_->stores().bin.remove_rows(6).value(), 0u);
  EXPECT_EQ(db_->stores().bin.binned(old.id).error().code, Errc::not_found);
  ASSERT_TRUE(db_->stores().bin.restore(young.id));
  MeasurementStore::Filter all;
  all.limit = 50;
  EXPECT_EQ(db_->stores().measurements.ranges(all).value().rows.size(), 10u);
}

TEST_P(MissionStoreContract, KeepsRunningTimeAndTheStreamOfTheDevices) {
  EXPECT_EQ(db_->stores().service.running_ns().value(), 0);
  ASSERT_TRUE(db_->stores().service.keep_running_ns(500));
  ASSERT_TRUE(db_->stores().service.keep_running_ns(400));
  EXPECT_EQ(db_->stores().service.running_ns().value(), 500) << "never goes back";
  const auto a = stored_mission(), b = stored_mission();
  EXPECT_TRUE(db_->stores().service.device_stream().value().empty());
  ASSERT_TRUE(db_->stores().service.keep_device_stream({b.id, a.id}));
  EXPECT_EQ(db_->stores().service.device_stream().value(), (std::vector{b.id, a.id}));
  ASSERT_TRUE(db_->stores().service.keep_device_stream({a.id}));
  EXPECT_EQ(db_->stores().service.device_stream().value(), std::vector{a.id});
}

TEST_P(MissionStoreContract, TakesMeasurementsAlongWhenTheBinIsEmptied) {
  const auto used = stored_mission();
  auto unused = stored_mission();
  unused.state = MissionState::finished;
  ASSERT_TRUE(db_->stores().missions.update(unused));
  for (const auto& m : {used, unused}) {
    Range row = range_at(m.id, 1);
    row.cir = Cir{};
    ASSERT_TRUE(db_->stores().measurements.append_ranges({row}, false));
    ASSERT_TRUE(db_->stores().measurements.append_fixes({fix_at(m.id, 1)}, false));
  }
  ASSERT_TRUE(db_->stores().bin.put(unused.id, k_noon, 0, "me"));
  ASSERT_TRUE(db_->stores().bin.empty(unused.id));
  while (db_->stores().bin.remove_rows(1).value() > 0) {
  }
  const auto left = db_->stores().measurements.ranges({}).value();
  ASSERT_EQ(left.rows.size(), 1u);
  EXPECT_EQ(left.rows[0].mission, used.id);
  EXPECT_EQ(db_->stores().measurements.devices(std::nullopt).value().size(), 2u);
}

INSTANTIATE_TEST_SUITE_P(Backends, MissionStoreContract, backends(), backend_name);

class AnchorStoreContract : public StoreContract {};

TEST_P(AnchorStoreContract, ChangesASiteOnlyFromTheVersionNamed) {
  Site site;
  site.id = SiteId{make_uuid_v7(k_noon)};
  site.name = "Ghent";
  site.origin = Wgs84{51.02, 3.71, 58.4};
  // Digits that no shorter text gives again, a hole, a ring that is not closed.
  site.outline = {{{3.7100000000000004, 51.02}, {3.72, 51.02}, {3.72, 51.030000000000001}, {3.71, 51.02}},
                  {{3.711, 51.021}, {3.712, 51.021}, {3.7121234567890123, 51.0221}}};
  site.crs_frame = "ETRS89";
  site.crs_epoch = 2026.34;
  site.base_sigma_m = 0.008;
  site.base_source = "known_point";
  site.created = k_noon;
  ASSERT_TRUE(db_->stores().sites.insert(site));
  EXPECT_EQ(db_->stores().sites.insert(site).error().code, Errc::conflict);
  site.name = "West";
  ASSERT_TRUE(db_->stores().sites.update(site, 1));
  EXPECT_EQ(db_->stores().sites.update(site, 1).error().code, Errc::conflict);
  const auto found = db_->stores().sites.site(site.id).value();
  EXPECT_EQ(found.version, 2u);
  EXPECT_EQ(found.name, "West");
  EXPECT_EQ(found.origin->lat_deg, 51.02);
  EXPECT_EQ(found.outline, site.outline);
  EXPECT_EQ(found.crs_epoch, 2026.34);
  EXPECT_EQ(found.base_sigma_m, 0.008);
  EXPECT_EQ(db_->stores().sites.sites(10, std::nullopt, std::nullopt).value().size(), 1u);
  Mission m;
  m.id = MissionId{make_uuid_v7(k_noon)};
  m.site = site.id;
  ASSERT_TRUE(db_->stores().missions.insert(m));
  EXPECT_EQ(db_->stores().sites.remove(site.id, 2).error().code, Errc::conflict);
  m.state = MissionState::finished;
  ASSERT_TRUE(db_->stores().missions.update(m));
  ASSERT_TRUE(db_->stores().bin.put(m.id, k_noon, 0, "me"));
  EXPECT_EQ(db_->stores().sites.remove(site.id, 2).error().code, Errc::conflict) << "it may come back";
  ASSERT_TRUE(db_->stores().bin.empty(m.id));
  EXPECT_EQ(db_->stores().bin.remove_rows(10).value(), 1u);
  EXPECT_EQ(db_->stores().sites.remove(site.id, 1).error().code, Errc::conflict) << "it changed since";
  ASSERT_TRUE(db_->stores().sites.remove(site.id, 2));
  EXPECT_EQ(db_->stores().sites.site(site.id).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().sites.update(site, 2).error().code, Errc::not_found);
}

TEST_P(AnchorStoreContract, MakesAnAnchorOnceAndKeepsItsFacilityData) {
  const auto made = db_->stores().anchors.find_or_create(NetworkId{0x6a2f}, k_noon).value();
  EXPECT_EQ(db_->stores().anchors.find_or_create(NetworkId{0x6a2f}, UtcTime{0}).value().id, made.id);
  Anchor changed = made;
  changed.name = "north-west";
  changed.floor = "0";
  changed.asset_tag = "UWB-000412";
  changed.ifc_guid = "2O2Fr$t4X7Zf8NOew3FLOH";
  changed.external_ids = {{"maximo", "LOC-88231"}, {"sap", "7"}};
  changed.retired = true;
  ASSERT_TRUE(db_->stores().anchors.update(changed, 1));
  EXPECT_EQ(db_->stores().anchors.update(changed, 1).error().code, Errc::conflict);
  const auto found = db_->stores().anchors.anchor(NetworkId{0x6a2f}).value();
  EXPECT_EQ(found.version, 2u);
  EXPECT_EQ(found.name, "north-west");
  EXPECT_EQ(found.external_ids, changed.external_ids);
  EXPECT_TRUE(found.retired);
  EXPECT_EQ(db_->stores().anchors.anchor(made.id).value().asset_tag, "UWB-000412");
  EXPECT_EQ(db_->stores().anchors.anchor(NetworkId{1}).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().anchors.anchors(10, std::nullopt).value().size(), 1u);
  EXPECT_EQ(db_->stores().anchors.anchors(10, made.id).value().size(), 0u);
}

TEST_P(AnchorStoreContract, GivesBackACalibrationAsItWas) {
  const auto mission = stored_mission();
  Calibration c;
  c.id = CalibrationId{make_uuid_v7(k_noon)};
  c.missions = {mission.id};
  c.origin = Wgs84{51, 3, 58};
  c.settings = {R"({"dims":3})"};
  c.created = k_noon;
  Estimate e;
  e.anchor = NetworkId{0x6a2f};
  e.time = k_noon;
  e.verdict = Verdict::ambiguous;
  e.reason = "two places fit";
  e.best = Hypothesis{
      {{1, 2, 3}}, Wgs84{51.1, 3.1, 60}, Eigen::Vector3d(1e-4, 2e-4, 3e-4).asDiagonal(), 0.047, 0.6};
  e.mirror = Hypothesis{{{1, 2, -3}}, std::nullopt, Eigen::Matrix3d::Identity(), 0.05, 0.4};
  e.h95_m = 0.05;
  e.v95_m = std::numeric_limits<double>::infinity();
  e.gdop = 2.31;
  e.n_used = 412;
  e.refused = {{"gap", 3}, {"zero_distance", 1}};
  e.bias_m = 0.23;
  Estimate lost;
  lost.anchor = NetworkId{2};
  lost.h95_m = std::numeric_limits<double>::quiet_NaN();
  c.anchors = {e, lost};
  ASSERT_TRUE(db_->stores().calibrations.insert(c));
  EXPECT_EQ(db_->stores().calibrations.insert(c).error().code, Errc::conflict);
  const auto found = db_->stores().calibrations.calibration(c.id).value();
  EXPECT_EQ(found.missions, c.missions);
  EXPECT_EQ(found.origin->height_m, 58);
  EXPECT_EQ(found.settings, c.settings);
  ASSERT_EQ(found.anchors.size(), 2u);
  const auto& f = found.anchors[0];
  EXPECT_EQ(f.verdict, Verdict::ambiguous);
  EXPECT_EQ(f.reason, e.reason);
  EXPECT_EQ(f.best->position.m, e.best->position.m);
  EXPECT_EQ(f.best->wgs84->lat_deg, 51.1);
  EXPECT_EQ(f.best->covariance_m2, e.best->covariance_m2);
  EXPECT_EQ(f.mirror->probability, 0.4);
  EXPECT_FALSE(f.mirror->wgs84);
  EXPECT_TRUE(std::isinf(f.v95_m));
  EXPECT_EQ(f.refused, e.refused);
  EXPECT_EQ(f.bias_m, 0.23);
  EXPECT_FALSE(f.lag_s);
  EXPECT_FALSE(found.anchors[1].best);
  EXPECT_TRUE(std::isnan(found.anchors[1].h95_m));
  EXPECT_EQ(db_->stores().calibrations.calibrations(10, std::nullopt).value().size(), 1u);
  ASSERT_TRUE(db_->stores().calibrations.remove(c.id));
  EXPECT_EQ(db_->stores().calibrations.calibration(c.id).error().code, Errc::not_found);
}

TEST_P(AnchorStoreContract, RefusesACalibrationOfAMissionThatIsNotThereAndLeavesNothing) {
  Calibration c;
  c.id = CalibrationId{make_uuid_v7(k_noon)};
  c.missions = {MissionId{make_uuid_v7(k_noon)}};
  EXPECT_EQ(db_->stores().calibrations.insert(c).error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().calibrations.calibration(c.id).error().code, Errc::not_found);
}

TEST_P(AnchorStoreContract, CarriesPositionsOnThatANewRevisionDoesNotSet) {
  const auto mission = stored_mission();
  EXPECT_TRUE(db_->stores().revisions.published(std::nullopt).value().empty());
  const auto first = stored_calibration(mission, {1, 2});
  const auto second = stored_calibration(mission, {2, 3});
  const auto r1 = db_->stores()
                      .revisions.publish(first.id, {NetworkId{1}, NetworkId{2}}, "token", "first", k_noon)
                      .value();
  EXPECT_EQ(r1.number, 1u);
  ASSERT_TRUE(db_->stores().revisions.publish(second.id, {NetworkId{2}}, "token", "", k_noon));
  const auto now = db_->stores().revisions.published(std::nullopt).value();
  ASSERT_EQ(now.size(), 2u);
  EXPECT_EQ(now[0].estimate.anchor, NetworkId{1});
  EXPECT_EQ(now[0].since_revision, 1u);
  EXPECT_EQ(now[0].calibration, first.id);
  EXPECT_EQ(now[1].since_revision, 2u);
  EXPECT_EQ(now[1].calibration, second.id);
  EXPECT_EQ(db_->stores().revisions.published(1).value()[1].calibration, first.id);
  EXPECT_EQ(db_->stores().revisions.published(3).error().code, Errc::not_found);
  for (const std::uint64_t number : {1, 2}) {
    const auto positions = db_->stores().revisions.published(number).value();
    for (const auto& whole : positions) {
      const auto alone = db_->stores().revisions.position(whole.estimate.anchor, number).value();
      ASSERT_TRUE(alone);
      EXPECT_EQ(alone->since_revision, whole.since_revision);
      EXPECT_EQ(alone->calibration, whole.calibration);
      EXPECT_EQ(alone->estimate.best->position.m, whole.estimate.best->position.m);
    }
  }
  EXPECT_FALSE(db_->stores().revisions.position(NetworkId{3}, 2).value()) << "never published";
  EXPECT_FALSE(db_->stores().revisions.position(NetworkId{1}, 3).value()) << "no such revision";
  const auto history = db_->stores().revisions.history(NetworkId{2}).value();
  ASSERT_EQ(history.size(), 2u);
  EXPECT_EQ(history[0].since_revision, 2u);
  const auto revisions = db_->stores().revisions.revisions(10, 0).value();
  ASSERT_EQ(revisions.size(), 2u);
  EXPECT_EQ(revisions[0].number, 2u);
  EXPECT_EQ(revisions[1].note, "first");
  EXPECT_EQ(db_->stores().revisions.revisions(10, 2).value().size(), 1u);
  EXPECT_EQ(db_->stores().calibrations.remove(first.id).error().code, Errc::conflict);
}

TEST_P(AnchorStoreContract, PublishesNothingWhenOneAnchorHasNoPosition) {
  const auto c = stored_calibration(stored_mission(), {1});
  const auto result = db_->stores().revisions.publish(c.id, {NetworkId{1}, NetworkId{2}}, "", "", k_noon);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::invalid_argument);
  EXPECT_TRUE(db_->stores().revisions.revisions(10, 0).value().empty());
}

TEST_P(AnchorStoreContract, KeepsGatesEvidenceAndWhoOverrodeWhat) {
  const auto mission = stored_mission();
  Calibration c;
  c.id = CalibrationId{make_uuid_v7(k_noon)};
  c.missions = {mission.id};
  c.provenance = {R"({"profile":null})"};
  c.evidence = {R"({"residuals":[1,2]})"};
  for (const std::uint32_t id : {1u, 2u}) {
    Estimate e;
    e.anchor = NetworkId{id};
    e.best = Hypothesis{};
    e.gates = {{"chi_square", 31.2, 16.3, id == 1, "31.2 over 16.3"},
               {"halves", std::nullopt, 16.3, false, "one half has no ranges"}};
    c.anchors.push_back(e);
  }
  ASSERT_TRUE(db_->stores().calibrations.insert(c));
  const auto read = db_->stores().calibrations.calibration(c.id).value();
  EXPECT_EQ(read.provenance, c.provenance);
  EXPECT_TRUE(read.evidence.empty()) << "read on its own";
  EXPECT_EQ(db_->stores().calibrations.evidence(c.id).value(), c.evidence.text);
  ASSERT_EQ(read.anchors[1].gates.size(), 2u);
  EXPECT_EQ(read.anchors[1].gates[0].name, "chi_square");
  EXPECT_EQ(read.anchors[1].gates[0].value, 31.2);
  EXPECT_FALSE(read.anchors[1].gates[0].passed);
  EXPECT_TRUE(read.anchors[0].gates[0].passed);
  EXPECT_FALSE(read.anchors[1].gates[1].value.has_value());

  const std::vector<NetworkId> both{NetworkId{1}, NetworkId{2}};
  EXPECT_EQ(
      db_->stores().revisions.publish(c.id, both, "t", "", k_noon, {{NetworkId{3}, "no", "t"}}).error().code,
      Errc::invalid_argument);
  ASSERT_TRUE(
      db_->stores().revisions.publish(c.id, both, "t", "", k_noon, {{NetworkId{2}, "taped", "token-7"}}));
  const auto published = db_->stores().revisions.published(std::nullopt).value();
  EXPECT_FALSE(published[0].overridden.has_value());
  ASSERT_TRUE(published[1].overridden.has_value());
  EXPECT_EQ(published[1].overridden->reason, "taped");
  EXPECT_EQ(published[1].overridden->by, "token-7");
  const auto later = stored_calibration(mission, {9});
  ASSERT_TRUE(db_->stores().revisions.publish(later.id, {NetworkId{9}}, "t", "", k_noon));
  EXPECT_TRUE(db_->stores().revisions.published(std::nullopt).value()[1].overridden.has_value())
      << "carried on";
}

TEST_P(AnchorStoreContract, KeepsEveryProfileOfAKitAndRefusesALostUpdate) {
  EXPECT_FALSE(db_->stores().kits.profile("kit-1").value().has_value());
  StoredProfile p{"kit-1", 0, k_noon, "token", "put", R"({"a":1})"};
  EXPECT_EQ(db_->stores().kits.put(p, 0).value().version, 1u);
  EXPECT_EQ(db_->stores().kits.put(p, 0).error().code, Errc::conflict);
  p.profile = {R"({"a":2})"};
  p.source = "calibration x";
  EXPECT_EQ(db_->stores().kits.put(p, 1).value().version, 2u);
  reopen();
  EXPECT_EQ(db_->stores().kits.profile("kit-1").value()->profile.text, R"({"a":2})");
  const auto history = db_->stores().kits.history("kit-1", 10).value();
  ASSERT_EQ(history.size(), 2u);
  EXPECT_EQ(history[1].source, "put");
  p.kit = "kit-0";
  ASSERT_TRUE(db_->stores().kits.put(p, 0));
  const auto newest = db_->stores().kits.newest().value();
  ASSERT_EQ(newest.size(), 2u);
  EXPECT_EQ(newest[0].kit, "kit-0");
  EXPECT_EQ(newest[1].version, 2u);
}

TEST_P(AnchorStoreContract, KeepsFramesByNameAndVersion) {
  Site site;
  site.id = SiteId{make_uuid_v7(k_noon)};
  site.projected_epsg = 25831;
  ASSERT_TRUE(db_->stores().sites.insert(site));
  EXPECT_EQ(db_->stores().sites.site(site.id).value().projected_epsg, 25831);
  LocalFrame frame{FrameId{make_uuid_v7(k_noon)}, "hall-a", site.id, R"({"pairs":[]})", k_noon, 1};
  ASSERT_TRUE(db_->stores().frames.insert(frame));
  LocalFrame other = frame;
  other.id = FrameId{make_uuid_v7(k_noon)};
  EXPECT_EQ(db_->stores().frames.insert(other).error().code, Errc::conflict);
  other.name = "hall-b";
  other.site.reset();
  ASSERT_TRUE(db_->stores().frames.insert(other));
  other.name = "hall-a";
  EXPECT_EQ(db_->stores().frames.update(other, 1).error().code, Errc::conflict);
  frame.definition = {R"({"pairs":[1]})"};
  ASSERT_TRUE(db_->stores().frames.update(frame, 1));
  EXPECT_EQ(db_->stores().frames.update(frame, 1).error().code, Errc::conflict);
  EXPECT_EQ(db_->stores().frames.frame("hall-a").value().version, 2u);
  EXPECT_EQ(db_->stores().frames.frames_of(site.id).value().size(), 1u);
  EXPECT_EQ(db_->stores().frames.frames(1, std::nullopt).value().size(), 1u);
  EXPECT_EQ(db_->stores().sites.remove(site.id, 1).error().code, Errc::conflict) << "a frame stands on it";
  EXPECT_EQ(db_->stores().frames.remove(frame.id, 1).error().code, Errc::conflict) << "it changed since";
  ASSERT_TRUE(db_->stores().frames.remove(frame.id, 2));
  EXPECT_EQ(db_->stores().frames.frame(frame.id).error().code, Errc::not_found);
}

INSTANTIATE_TEST_SUITE_P(Backends, AnchorStoreContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::catalogue_contract_test
