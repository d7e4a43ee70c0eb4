// A flight as rows for another server, over every backend, and from each to SQLite and back.
#include <algorithm>

#include "core/ports/anchor_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/kit_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"
#include "tests/server/storage/backends.hpp"
#include "tests/server/storage/bundle_rows.hpp"

namespace anchord::bundle_contract_test {
namespace {

class BundleStoreContract : public StoreContract {
 protected:
  /// A finished flight with something in nearly every table; its kit learns another version of the profile.
  MissionId flown(std::uint64_t learned = 0) {
    const Stores s = db_->stores();
    Site site;
    site.id = SiteId{make_uuid_v7(k_noon)};
    site.name = "hall";
    site.origin = Wgs84{51.1 / 3, 3.7, -0.0};
    site.created = k_noon;
    EXPECT_TRUE(s.sites.insert(site));
    Mission m;
    m.id = MissionId{make_uuid_v7(k_noon)};
    m.site = site.id;
    m.name = "flight";
    m.kit = "kit";
    m.tags = {{NetworkId{0x6e01}, 0, {0.1, 0.2, 0.3}}};
    m.lever_arm_sigma_m = 0.1 / 3;
    m.created = k_noon;
    EXPECT_TRUE(s.missions.insert(m));
    std::vector<Range> ranges;
    for (int i = 0; i < 40; ++i) ranges.push_back(range_at(m.id, i));
    ranges[3].seq = 7;
    ranges[4].cir.emplace();
    ranges[4].cir->re_im = {0, -1, 32767, -32768};
    EXPECT_TRUE(s.measurements.append_ranges(ranges, true));
    StoredProfile profile;
    profile.kit = "kit";
    profile.time = k_noon;
    profile.by = profile.source = "test";
    profile.profile = {"{}"};
    EXPECT_TRUE(s.kits.put(profile, learned));
    Exclusion e;
    e.id = ExclusionId{make_uuid_v7(k_noon)};
    e.mission = m.id;
    e.selection.since = k_noon;
    e.reason = "why";
    e.created = k_noon;
    EXPECT_TRUE(s.exclusions.insert(e, {}));
    EXPECT_TRUE(s.exclusions.include(m.id, e.id, {k_noon, "me", "not so"}));
    EXPECT_TRUE(s.missions.finish(m.id, k_noon));
    const Calibration c = stored_calibration(m, {0x6a21, 0x6a22});
    EXPECT_TRUE(s.revisions.publish(c.id, {NetworkId{0x6a21}}, "me", "", k_noon));
    return m.id;
  }
  static std::vector<std::string> left_out(const BundleOutcome& outcome) {
    std::vector<std::string> out;
    for (const auto& one : outcome.left_out) out.push_back(one.what + ": " + one.why);
    return out;
  }
  static std::map<std::string, std::uint64_t> added(const BundleOutcome& outcome) {
    std::map<std::string, std::uint64_t> out;
    for (const auto& table : outcome.tables)
      if (table.n_added > 0) out[table.name] = table.n_added;
    return out;
  }
  /// Of a finished flight: ranges earlier and later than all others, one of an anchor that was not heard, one
  /// with an impulse response; and positions.
  static bool append_late(Database& db, const MissionId& mission) {
    std::vector<Range> ranges{range_at(mission, -7), range_at(mission, 60), range_at(mission, 61)};
    ranges[0].seq.reset();
    ranges[1].anchor = NetworkId{0x6a99};
    ranges[2].cir.emplace();
    ranges[2].cir->re_im = {5, -5};
    const std::vector<Fix> fixes{fix_at(mission, 3), fix_at(mission, 4)};
    const Stores s = db.stores();
    return s.measurements.append_ranges(ranges, true).has_value() &&
           s.measurements.append_fixes(fixes, true).has_value();
  }
  /// What is measured, whatever the order in which it came, and what is counted of it.
  static void expect_same_measurements(Database& a, Database& b, const MissionId& mission) {
    BundleRows one = written(a, mission), other = written(b, mission);
    for (auto* rows : {&one, &other}) {
      for (const char* table : {"uwb_range", "fix"}) {
        const std::size_t received = table == std::string("fix") ? 1 : 2;
        for (auto& row : rows->tables[table]) row[received] = std::monostate{};
        std::ranges::sort(rows->tables[table]);
      }
    }
    for (const char* table : {"uwb_range", "fix", "device_seen"})
      EXPECT_EQ(one.tables[table], other.tables[table]) << table;
  }
  static BundleRows written(Database& db, const MissionId& mission) {
    BundleRows rows;
    const auto done = db.stores().bundles.write_out(mission, rows);
    EXPECT_TRUE(done) << done.error().message;
    return rows;
  }
};

TEST_P(BundleStoreContract, ComeBackTheSameFromAnotherDatabase) {
  const auto mission = flown();
  BundleRows rows = written(*db_, mission);
  EXPECT_EQ(rows.tables.at("uwb_range").size(), 40u);
  EXPECT_EQ(rows.tables.at("exclusion_taken_back").size(), 1u);
  EXPECT_EQ(rows.tables.at("revision_position").size(), 1u);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  const auto taken = other->stores().bundles.take_in(mission, rows);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_TRUE(taken.value().left_out.empty());
  EXPECT_EQ(written(*other, mission).tables, rows.tables);
  const auto back = db_->stores().bundles.take_in(mission, rows);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_FALSE(back.value().added()) << "all of it is here";
}

TEST_P(BundleStoreContract, HaveALeverArmSigmaWithinItsLimitsOrNone) {
  const auto mission = flown();
  BundleRows rows = written(*db_, mission);
  BundleCell& sigma = rows.tables["mission"][0].back();
  EXPECT_EQ(sigma, BundleCell{0.1 / 3});
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  for (const double refused : {0.0, -0.02, 10.5, 1e300}) {
    sigma = refused;
    const auto taken = other->stores().bundles.take_in(mission, rows);
    ASSERT_FALSE(taken) << refused;
    EXPECT_EQ(taken.error().code, Errc::invalid_argument);
    EXPECT_NE(taken.error().message.find("0.001 to 10 m"), std::string::npos) << taken.error().message;
  }
  sigma = std::monostate{};
  ASSERT_TRUE(other->stores().bundles.take_in(mission, rows));
  EXPECT_EQ(other->stores().missions.mission(mission).value().lever_arm_sigma_m, std::nullopt);
}

TEST_P(BundleStoreContract, AreTakenFromSqlite) {
  const auto here = std::exchange(db_, nullptr);
  ScratchDir folder;
  db_ = open_sqlite(folder.path() / "data");
  const auto mission = flown();
  BundleRows rows = written(*db_, mission);
  const auto taken = here->stores().bundles.take_in(mission, rows);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_EQ(written(*here, mission).tables, rows.tables);
}

TEST_P(BundleStoreContract, AreRefusedWholeWhereAMeasurementDiffers) {
  const auto mission = flown();
  BundleRows rows = written(*db_, mission);
  auto& distance_m = std::get<double>(rows.tables["uwb_range"][39][7]);
  EXPECT_EQ(distance_m, 5.039);
  distance_m += 0.001;
  const auto differs = db_->stores().bundles.take_in(mission, rows);
  ASSERT_FALSE(differs);
  EXPECT_EQ(differs.error().code, Errc::conflict);
  for (const char* part : {"uwb_range 1777889472735678000 0x6e01 0x0103", "(distance_m)"})
    EXPECT_NE(differs.error().message.find(part), std::string::npos) << differs.error().message;
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  rows.tables["estimate"][0][0] = std::string(16, '\0');  // of a calibration that is nowhere
  EXPECT_FALSE(other->stores().bundles.take_in(mission, rows));
  EXPECT_FALSE(other->stores().missions.mission(mission)) << "nothing of it stays";
}

// A second flight of the kit was refused with 409 "kit_profile kit 2 exists on this server with other content
// (t_ns)".
TEST_P(BundleStoreContract, OfALaterFlightOfTheKitComeWhereTheProfileIsTheSameOrAnother) {
  const auto first = flown();
  BundleRows of_first = written(*db_, first);
  const auto second = flown(1);
  BundleRows of_second = written(*db_, second);
  ScratchDir same, other;
  const auto follows = open_sqlite(same.path() / "data"), learns = open_sqlite(other.path() / "data");
  for (Database* db : {follows.get(), learns.get()})
    ASSERT_TRUE(db->stores().bundles.take_in(first, of_first));
  StoredProfile own;
  own.kit = "kit";
  own.time = k_noon;
  own.by = own.source = "of its own flight";
  own.profile = {R"({"own":1})"};
  ASSERT_TRUE(learns->stores().kits.put(own, 1));

  const auto taken = follows->stores().bundles.take_in(second, of_second);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_EQ(follows->stores().kits.profile("kit").value()->version, 2u);
  const auto beside = learns->stores().bundles.take_in(second, of_second);
  ASSERT_TRUE(beside) << beside.error().message;
  EXPECT_THAT(left_out(beside.value()), ::testing::Contains(::testing::HasSubstr("kit_profile kit 2")));
  EXPECT_EQ(written(*learns, second).tables.at("uwb_range"), of_second.tables.at("uwb_range"));
  EXPECT_EQ(learns->stores().kits.profile("kit").value()->source, "of its own flight");
}

TEST_P(BundleStoreContract, LeaveSitesFramesAndAnchorsAsTheyAreHere) {
  const auto mission = flown();
  const Stores from = db_->stores();
  auto site = from.sites.site(*from.missions.mission(mission).value().site).value();
  auto anchor = from.anchors.find_or_create(NetworkId{0x101}, k_noon).value();
  anchor.name = "field";
  anchor.external_ids = {{"cmms", "7"}};
  ASSERT_TRUE(from.anchors.update(anchor, anchor.version));
  LocalFrame frame;
  frame.id = FrameId{make_uuid_v7(k_noon)};
  frame.name = "hall-a";
  frame.site = site.id;
  frame.created = k_noon;
  ASSERT_TRUE(from.frames.insert(frame));
  BundleRows rows = written(*db_, mission);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  const Stores here = other->stores();
  site.name = "hall 3";
  ASSERT_TRUE(here.sites.insert(site));
  frame.id = FrameId{make_uuid_v7(k_noon)};
  ASSERT_TRUE(here.frames.insert(frame));
  ASSERT_TRUE(here.anchors.find_or_create(NetworkId{0x101}, k_noon));
  const auto taken = here.bundles.take_in(mission, rows);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_THAT(left_out(taken.value()),
              ::testing::UnorderedElementsAre(
                  ::testing::HasSubstr("(name), which stays"),
                  ::testing::HasSubstr("another frame has the name hall-a on this server"),
                  ::testing::HasSubstr("anchor 0x0101")));
  EXPECT_EQ(here.sites.site(site.id).value().name, "hall 3");
  EXPECT_EQ(here.anchors.anchor(NetworkId{0x101}).value().name, "");
  EXPECT_EQ(written(*other, mission).tables.at("uwb_range"), rows.tables.at("uwb_range"));
  EXPECT_FALSE(here.bundles.take_in(mission, rows).value().added());
}

// A second bundle of a flight with more rows was refused for ever with 409 "exists on this server without".
TEST_P(BundleStoreContract, BringRowsThatCameLateOnceAndCountThemAsTheyAre) {
  const auto mission = flown();
  BundleRows first = written(*db_, mission);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().bundles.take_in(mission, first));
  ASSERT_TRUE(append_late(*db_, mission));
  BundleRows more = written(*db_, mission);
  const auto taken = other->stores().bundles.take_in(mission, more);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_EQ(added(taken.value()), (std::map<std::string, std::uint64_t>{{"fix", 2}, {"uwb_range", 3}}));
  EXPECT_TRUE(taken.value().left_out.empty());
  expect_same_measurements(*other, *db_, mission);
  EXPECT_EQ(other->stores().measurements.count_ranges(mission).value(), 43u);
  EXPECT_EQ(other->stores().measurements.count_fixes(mission).value(), 2u);
  for (BundleRows* again : {&more, &first}) {
    const auto there = other->stores().bundles.take_in(mission, *again);
    ASSERT_TRUE(there) << there.error().message;
    EXPECT_FALSE(there.value().added());
  }
  expect_same_measurements(*other, *db_, mission);
}

TEST_P(BundleStoreContract, OfOneFlightWithRowsThatCameLateToEachServerMakeTheSameOfBoth) {
  const auto mission = flown();
  BundleRows first = written(*db_, mission);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().bundles.take_in(mission, first));
  ASSERT_TRUE(append_late(*db_, mission));
  std::vector<Range> theirs{range_at(mission, 100), range_at(mission, 60)};
  theirs[1].anchor = NetworkId{0x6a99};
  theirs[1].received = k_noon;  // sent to both: it arrived at another time
  ASSERT_TRUE(other->stores().measurements.append_ranges(theirs, true));
  BundleRows here = written(*db_, mission), there = written(*other, mission);
  ASSERT_TRUE(other->stores().bundles.take_in(mission, here));
  ASSERT_TRUE(db_->stores().bundles.take_in(mission, there));
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission).value(), 44u);
  expect_same_measurements(*other, *db_, mission);
}

TEST_P(BundleStoreContract, WithALateRowThatDiffersBringNoneOfTheOthers) {
  const auto mission = flown();
  BundleRows first = written(*db_, mission);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().bundles.take_in(mission, first));
  ASSERT_TRUE(append_late(*db_, mission));
  BundleRows more = written(*db_, mission);
  std::vector<Fix> moved{fix_at(mission, 4)};
  moved[0].position.height_m += 1;
  ASSERT_TRUE(other->stores().measurements.append_fixes(moved, true));
  const auto refused = other->stores().bundles.take_in(mission, more);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::conflict);
  EXPECT_NE(refused.error().message.find("fix 1777889472745678000"), std::string::npos)
      << refused.error().message;
  EXPECT_EQ(written(*other, mission).tables.at("uwb_range"), first.tables.at("uwb_range"));
  EXPECT_EQ(other->stores().measurements.count_ranges(mission).value(), 40u);
  BundleRows counted = written(*db_, mission);
  std::get<std::int64_t>(counted.tables["device_seen"][0].back()) += 1;
  counted.tables["fix"].clear();
  const auto miscounted = other->stores().bundles.take_in(mission, counted);
  ASSERT_FALSE(miscounted);
  EXPECT_NE(miscounted.error().message.find("device_seen"), std::string::npos);
}

// Was refused with 409 and "correct it here as it was there".
TEST_P(BundleStoreContract, LeaveAFlightThatWasCorrectedAsItIsHereAndBringItsRows) {
  const auto mission = flown();
  BundleRows first = written(*db_, mission);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().bundles.take_in(mission, first));
  auto corrected = other->stores().missions.mission(mission).value();
  corrected.name = "named at the centre";
  corrected.tags[0].lever_arm_body_m.x() = 0.5;
  ASSERT_TRUE(other->stores().missions.update(corrected));
  auto ours = db_->stores().missions.mission(mission).value();
  ours.kit = "kit 2";
  ours.tags.push_back({NetworkId{0x6e02}, 0, {0, 0, 0}});
  ASSERT_TRUE(db_->stores().missions.update(ours));
  ASSERT_TRUE(append_late(*db_, mission));
  BundleRows more = written(*db_, mission);
  const auto taken = other->stores().bundles.take_in(mission, more);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_THAT(left_out(taken.value()),
              ::testing::UnorderedElementsAre(
                  ::testing::AllOf(::testing::StartsWith("mission " + to_string(mission)),
                                   ::testing::HasSubstr("(name, kit), which stays")),
                  ::testing::AllOf(::testing::StartsWith("mission_tag 0"),
                                   ::testing::HasSubstr("(lever_arm_forward_m), which stays")),
                  ::testing::StartsWith("mission_tag 1")));
  const auto there = other->stores().missions.mission(mission).value();
  EXPECT_EQ(there.name, "named at the centre");
  EXPECT_EQ(there.kit, "kit");
  ASSERT_EQ(there.tags.size(), 1u);
  EXPECT_EQ(there.tags[0].lever_arm_body_m.x(), 0.5);
  expect_same_measurements(*other, *db_, mission);
  BundleRows back = written(*other, mission);
  const auto down = db_->stores().bundles.take_in(mission, back);
  ASSERT_TRUE(down) << down.error().message;
  EXPECT_THAT(left_out(down.value()),
              ::testing::Contains(::testing::HasSubstr("has 2 on this server, not 1")));
  back.tables["mission"][0][5] = std::int64_t{1};  // its rows are in another frame
  EXPECT_EQ(db_->stores().bundles.take_in(mission, back).error().code, Errc::conflict);
}

TEST_P(BundleStoreContract, LeaveAnExclusionThatBothTookBackAsItIsHere) {
  const auto mission = flown();
  BundleRows rows = written(*db_, mission);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().bundles.take_in(mission, rows));
  rows.tables["exclusion_taken_back"][0][1] = std::string("another word");
  const auto taken = other->stores().bundles.take_in(mission, rows);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_THAT(left_out(taken.value()), ::testing::ElementsAre(::testing::HasSubstr("exclusion_taken_back")));
  rows.tables["exclusion"][0][7] = std::string("another reason");
  EXPECT_EQ(other->stores().bundles.take_in(mission, rows).error().code, Errc::conflict);
}

// Where both had published one revision, their numbers were the same and the flight was refused with 409.
TEST_P(BundleStoreContract, LeaveARevisionOfTheSameNumberOut) {
  const auto mission = flown();
  BundleRows rows = written(*db_, mission);
  const auto here = std::exchange(db_, nullptr);
  ScratchDir folder;
  db_ = open_sqlite(folder.path() / "data");
  const auto own = flown();
  const auto taken = db_->stores().bundles.take_in(mission, rows);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_THAT(left_out(taken.value()), ::testing::Contains(::testing::HasSubstr("revision 1: this server")));
  EXPECT_EQ(written(*db_, own).tables.at("revision").size(), 1u);
}

TEST_P(BundleStoreContract, AreOfFinishedMissionsAlone) {
  BundleRows rows;
  const auto records = db_->stores().bundles.write_out(stored_mission().id, rows);
  ASSERT_FALSE(records);
  EXPECT_EQ(records.error().code, Errc::conflict);
  EXPECT_EQ(db_->stores().bundles.write_out(MissionId{make_uuid_v7(k_noon)}, rows).error().code,
            Errc::not_found);
}

INSTANTIATE_TEST_SUITE_P(Backends, BundleStoreContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::bundle_contract_test
