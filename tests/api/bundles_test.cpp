// A flight leaves one server as a file and stands on another as it was: the same ids, rows and anchors; all
// or nothing; whatever is not what the manifest says is refused. And the signed pack that is handed over.
#include <sqlite3.h>

#include <fstream>
#include <set>

#include "api/formats/bundle.hpp"
#include "api/formats/handover.hpp"
#include "app_fixture.hpp"
#include "core/base/sha256.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/event_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"
#include "tests/api/zip_builder.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::test {
namespace {

using api::Method;
using Entries = std::vector<std::pair<std::string, std::string>>;

/// A server beside that of the test, with a database of its own.
class OtherServer final : public AppFixture {
 public:
  OtherServer() { SetUp(); }
  ~OtherServer() override { TearDown(); }
  void TestBody() override {}
  using AppFixture::get;
  api::Response take(const std::string& bytes) { return post("/api/v1/bundles", bytes, "application/zip"); }
  Stores stores() { return database_->stores(); }
  api::Response solve(const std::string& mission) {
    Call options;
    options.headers["prefer"] = "wait=120";
    return call(Method::post, "/api/v1/calibrations", R"({"missions":[")" + mission + "\"]}", options);
  }
};

/// Every row of a flight.
struct Rows final : BundleSink {
  std::map<std::string, std::vector<BundleRow>> tables;
  std::vector<BundleRow>* now{nullptr};
  Result<void> begin(const BundleTable& table) override {
    now = &tables[table.name];
    return boost::outcome_v2::success();
  }
  Result<void> row(const BundleRow& row) override {
    now->push_back(row);
    return boost::outcome_v2::success();
  }
};
Rows rows_of(Stores stores, const MissionId& mission) {
  Rows out;
  const auto written = stores.bundles.write_out(mission, out);
  EXPECT_TRUE(written) << written.error().message;
  return out;
}

class Bundles : public AppFixture {
 protected:
  /// A flight of a site: finished, rows taken out and back, calibrated, its kit learned, published.
  void SetUp() override {
    AppFixture::SetUp();
    testing::MadeFlight made;
    made.frame = TrackFrame::wgs84;
    auto flight = testing::make_flight(made);
    Site site;
    site.id.uuid = make_uuid_v7(clock_.now());
    site.name = "Hall \xC3\xA9";
    site.origin = made.origin;
    site.created = clock_.now();
    Stores s = database_->stores();
    ASSERT_TRUE(s.sites.insert(site));
    Mission mission = flight.mission;
    id_ = MissionId{make_uuid_v7(clock_.now())};
    mission.id = id_;
    mission.site = site.id;
    mission.name = "north side";
    mission.kit = "kit-1";
    mission.created = clock_.now();
    ASSERT_TRUE(s.missions.insert(mission));
    for (auto& fix : flight.fixes) fix.mission = id_;
    for (auto& range : flight.ranges) range.mission = id_;
    flight.ranges[5].cir.emplace();
    flight.ranges[5].cir->re_im = {0, 1, -1, 32767, -32768, 7};
    flight.ranges[5].cir->first_path_idx = 0.25;
    n_ranges_ = flight.ranges.size();
    ASSERT_TRUE(s.measurements.append_fixes(flight.fixes, true));
    ASSERT_TRUE(s.measurements.append_ranges(flight.ranges, true));
    const auto devices = s.measurements.devices(id_);
    for (const auto& device : devices.value()) {
      if (device.kind != DeviceSeen::Kind::anchor) continue;
      ASSERT_TRUE(s.anchors.find_or_create(device.network_id, clock_.now()));
    }
    Exclusion exclusion;
    exclusion.id.uuid = make_uuid_v7(clock_.now());
    exclusion.mission = id_;
    exclusion.reason = "a crane";
    exclusion.by = "tester";
    exclusion.created = clock_.now();
    ASSERT_TRUE(s.exclusions.insert(exclusion, {7, 8, 9}));
    ASSERT_TRUE(s.missions.finish(id_, clock_.now()));
    calibration_ = solved(*this, to_string(id_));
    const auto solved = s.calibrations.calibration(calibration_).value();
    ASSERT_TRUE(
        s.revisions.publish(calibration_, {solved.anchors.front().anchor}, "tester", "", clock_.now()));
  }
  template <class Server>
  static CalibrationId solved(Server& server, const std::string& mission) {
    const auto done = solve_on(server, mission);
    EXPECT_EQ(done.status, 201) << done.body;
    return CalibrationId{parse_uuid(json(done).value("id", "")).value()};
  }
  static api::Response solve_on(OtherServer& server, const std::string& mission) {
    return server.solve(mission);
  }
  static api::Response solve_on(Bundles& server, const std::string& mission) {
    Call options;
    options.headers["prefer"] = "wait=120";
    return server.call(Method::post, "/api/v1/calibrations", R"({"missions":[")" + mission + "\"]}", options);
  }
  void configure(api::Application::Deps& deps) override {
    deps.spool_dir = dir_ / "spool";
    deps.print_pdf = [this](const std::filesystem::path& html, const std::filesystem::path& pdf) {
      if (!prints_) return Result<void>(make_error(Errc::unsupported, "nothing prints here"));
      std::ofstream(pdf) << "%PDF-1.7 of " << std::filesystem::file_size(html);
      return Result<void>(boost::outcome_v2::success());
    };
  }
  bool prints_{false};
  static Json json_of(const std::string& text) { return Json::parse(text); }
  std::string path(const char* tail) const { return "/api/v1/missions/" + to_string(id_) + tail; }
  std::string bundle() {
    const auto answer = get(path("/bundle"));
    EXPECT_EQ(answer.status, 200) << answer.body;
    return text(answer);
  }
  Entries entries_of(const std::string& bytes) const {
    const auto file = dir_ / "looked at.zip";
    std::ofstream(file, std::ios::binary) << bytes;
    const auto zip = api::ZipReader::open(file);
    EXPECT_TRUE(zip) << zip.error().message;
    Entries out;
    for (const auto& entry : zip.value().entries())
      out.emplace_back(entry.name, zip.value().text(entry.name, std::uint64_t{1} << 30).value());
    return out;
  }
  static std::string zip_of(const Entries& entries) {
    ZipBuilder zip;
    for (const auto& [name, content] : entries) zip.add({name, content, true});
    return zip.bytes();
  }
  static std::string& content(Entries& entries, const std::string& name) {
    const auto at =
        std::find_if(entries.begin(), entries.end(), [&](const auto& e) { return e.first == name; });
    EXPECT_NE(at, entries.end()) << name;
    return at->second;
  }
  /// As a forger would: the manifest says again what the entries are.
  static void say_again(Entries& entries) {
    auto manifest = api::read_bundle_manifest(content(entries, "manifest.json")).value();
    for (auto& entry : manifest.entries) {
      const std::string& text = content(entries, entry.name);
      Sha256 sum;
      sum.add(text);
      entry.bytes = text.size();
      entry.sha256_hex = sum.hex();
    }
    content(entries, "manifest.json") = api::write_bundle_manifest(manifest);
  }
  /// A row of a table changed, and the bundle made good again.
  std::string forged(const std::string& table, const std::string& from, const std::string& to) {
    auto entries = entries_of(bundle());
    std::string& text = content(entries, "tables/" + table + ".ndjson");
    const auto at = text.find(from, text.find('\n'));
    EXPECT_NE(at, std::string::npos) << from << " in " << text.substr(0, 500);
    text.replace(at, from.size(), to);
    say_again(entries);
    return zip_of(entries);
  }
  static void expect_nothing(OtherServer& server) {
    EXPECT_TRUE(json(server.get("/api/v1/missions"))["items"].empty());
    EXPECT_TRUE(json(server.get("/api/v1/sites"))["items"].empty());
  }

  MissionId id_{};
  CalibrationId calibration_{};
  std::size_t n_ranges_{};
};

TEST_F(Bundles, CarryEveryRowToAnotherServerUnderTheSameIds) {
  OtherServer other;
  const auto taken = other.take(bundle());
  ASSERT_EQ(taken.status, 201) << taken.body;
  EXPECT_EQ(header(taken, "Location"), path(""));
  EXPECT_EQ(json(taken)["added"]["uwb_range"], n_ranges_);
  EXPECT_TRUE(json(taken)["left_out"].empty()) << taken.body;
  const auto here = rows_of(database_->stores(), id_), there = rows_of(other.stores(), id_);
  for (const auto& [name, rows] : here.tables) EXPECT_EQ(rows, there.tables.at(name)) << name;
  EXPECT_EQ(here.tables.at("uwb_range").size(), n_ranges_);
  for (const char* name : {"site", "mission", "fix", "exclusion", "exclusion_row", "calibration", "estimate",
                           "calibration_evidence", "revision", "revision_position", "anchor", "device_seen"})
    EXPECT_FALSE(there.tables.at(name).empty()) << name;
  EXPECT_EQ(other.get("/api/v1/anchors").body.substr(0, 40), get("/api/v1/anchors").body.substr(0, 40));
}

TEST_F(Bundles, GiveTheSameAnchorsWhenCalibratedAgain) {
  OtherServer other;
  ASSERT_EQ(other.take(bundle()).status, 201);
  const auto here =
      database_->stores().calibrations.calibration(solved(*this, to_string(id_))).value().anchors;
  const auto there = other.stores().calibrations.calibration(solved(other, to_string(id_))).value().anchors;
  ASSERT_EQ(here.size(), there.size());
  ASSERT_GE(here.size(), 3u);
  for (std::size_t i = 0; i < here.size(); ++i) {
    ASSERT_TRUE(here[i].best && there[i].best);
    EXPECT_EQ(here[i].anchor, there[i].anchor);
    EXPECT_LT((here[i].best->position.m - there[i].best->position.m).norm(), 1e-9)
        << "the same rows in the same order: " << to_string(here[i].anchor);
  }
}

TEST_F(Bundles, AreTakenOnceHoweverOftenTheyAreSent) {
  OtherServer other;
  const auto bytes = bundle();
  ASSERT_EQ(other.take(bytes).status, 201);
  const auto rows = rows_of(other.stores(), id_).tables;
  const auto again = other.take(bytes);
  EXPECT_EQ(again.status, 200) << again.body;
  EXPECT_EQ(json(again)["already"], true);
  EXPECT_EQ(rows_of(other.stores(), id_).tables, rows);
  EXPECT_EQ(post("/api/v1/bundles", bytes, "application/zip").status, 200) << "and where it comes from";
  const auto log = other.get("/api/v1/audit").body;
  EXPECT_NE(log.find("bundle.import " + to_string(id_)), std::string::npos) << log;
}

TEST_F(Bundles, HaveTheSameDigestAsLongAsTheFlightIsTheSame) {
  const auto digest = [&] {
    auto entries = entries_of(bundle());
    return json_of(content(entries, "manifest.json"))["digest"].get<std::string>();
  };
  const auto before = digest();
  ASSERT_EQ(get(path("/handover")).status, 200);  // which the audit log tells, and with it a note
  EXPECT_EQ(digest(), before);
}

/// The names of the columns of bundles of before missions had a sigma of their lever arms.
constexpr const char* k_mission_before =
    R"(["id","site_id","name","kit","radio","frame","track_point","state","created_t_ns","finished_t_ns"])";

TEST_F(Bundles, OfMissionsWithoutALeverArmSigmaAreThoseOfBeforeThereWasOne) {
  auto entries = entries_of(bundle());
  const std::string& table = content(entries, "tables/mission.ndjson");
  EXPECT_EQ(table.substr(0, table.find('\n')), k_mission_before);
  OtherServer other;
  ASSERT_EQ(other.take(bundle()).status, 201);
  EXPECT_EQ(other.stores().missions.mission(id_).value().lever_arm_sigma_m, std::nullopt);
}

TEST_F(Bundles, CarryTheLeverArmSigmaOfTheirMission) {
  auto mission = database_->stores().missions.mission(id_).value();
  mission.lever_arm_sigma_m = 0.03;
  ASSERT_TRUE(database_->stores().missions.update(mission));
  OtherServer other;
  const auto taken = other.take(bundle());
  ASSERT_EQ(taken.status, 201) << taken.body;
  EXPECT_EQ(other.stores().missions.mission(id_).value().lever_arm_sigma_m, 0.03);
  EXPECT_EQ(json(other.get(path("")))["lever_arm_sigma_m"], 0.03);
  OtherServer third;
  const auto far = third.take(forged("mission", ",0.03]", ",30.0]"));
  EXPECT_EQ(far.status, 422) << far.body;
  EXPECT_NE(far.body.find("0.001 to 10 m"), std::string::npos) << far.body;
  // The name alone does not make a column.
  EXPECT_GE(third.take(forged("mission", ",0.03]", "]")).status, 400);
  expect_nothing(third);
}

TEST_F(Bundles, BringLaterWordsOfTheFlightToo) {
  OtherServer other;
  ASSERT_EQ(other.take(bundle()).status, 201);
  solved(*this, to_string(id_));
  const auto later = other.take(bundle());
  EXPECT_EQ(later.status, 201) << later.body;
  EXPECT_EQ(json(later)["added"]["calibration"], 1);
  EXPECT_FALSE(json(later)["added"].contains("uwb_range"));
}

TEST_F(Bundles, AreRefusedWhereAMeasurementDiffersButNotWhereASiteWasRenamed) {
  OtherServer other;
  const auto bytes = bundle();
  ASSERT_EQ(other.take(bytes).status, 201);
  const auto mission = database_->stores().missions.mission(id_).value();
  auto site = other.stores().sites.site(*mission.site).value();
  site.name = "renamed here";
  ASSERT_TRUE(other.stores().sites.update(site, site.version));
  const auto again = other.take(bytes);
  EXPECT_EQ(again.status, 200) << again.body;
  EXPECT_EQ(json(again)["left_out"][0]["what"], "site " + to_string(site.id));
  EXPECT_EQ(other.stores().sites.site(site.id).value().name, "renamed here");
  // A range that was measured otherwise: the flight is another one.
  const auto measured = post("/api/v1/bundles", forged("uwb_range", ",0,", ",3,"), "application/zip");
  EXPECT_EQ(measured.status, 409) << measured.body;
  EXPECT_NE(measured.body.find(to_string(id_)), std::string::npos) << measured.body;
}

TEST_F(Bundles, BringTheEventsOfTheirFlightOnce) {
  LiveEvent sent;
  sent.time = UtcTime::from_us(1'777'889'472'000'000);
  sent.id = EventId{make_uuid_v7(sent.time)};
  sent.level = EventLevel::warning;
  sent.code = "procedure.go_to_point";
  sent.text = "to \"Z\xC3\xBCrich\"";
  sent.mission = id_;
  sent.place = {51.25, -179.5, 7.125};
  ASSERT_TRUE(database_->stores().events.append(std::span(&sent, 1)));
  const auto bytes = bundle();
  OtherServer other;
  ASSERT_EQ(other.take(bytes).status, 201);
  ASSERT_EQ(other.take(bytes).status, 200);
  const Json here = json(get(path("/events"))), there = json(other.get(path("/events")));
  const auto of = [](const Json& all) {
    std::vector<Json> found;
    for (const auto& event : all["items"])
      if (event["code"] == "procedure.go_to_point") found.push_back(event);
    return found;
  };
  ASSERT_EQ(of(here).size(), 1u);
  EXPECT_EQ(of(there), of(here));
}

TEST_F(Bundles, WhoseEventsAreNoneBringNothing) {
  for (const char* line :
       {"x", "[]", "{}", R"({"id":"1","t_us":1,"level":"info","code":"a","text":"b"})",
        R"({"id":"01a211df-8b78-77ea-8dc4-df6596c7fea9","t_us":-1,"level":"info",)"
        R"("code":"a","text":"b"})",
        R"({"id":"01a211df-8b78-77ea-8dc4-df6596c7fea9","t_us":1,"level":"info",)"
        R"("code":"a","text":"b","place":{"lon":1e9,"lat":0,"height_above_ground_m":0}})"}) {
    auto entries = entries_of(bundle());
    content(entries, "notes/events.ndjson") = std::string(line) + "\n";
    say_again(entries);
    OtherServer other;
    const auto refused = other.take(zip_of(entries));
    EXPECT_EQ(refused.status, 422) << line;
    EXPECT_NE(refused.body.find("notes/events.ndjson line 1"), std::string::npos) << refused.body;
    expect_nothing(other);
  }
}

TEST_F(Bundles, OfASiteBringItsFlightsAndWhatNoFlightUsed) {
  const Stores s = database_->stores();
  const auto mission = s.missions.mission(id_).value();
  Mission second = mission;
  second.id = MissionId{make_uuid_v7(clock_.now())};
  second.name = "south side";
  second.state = MissionState::recording;
  ASSERT_TRUE(s.missions.insert(second));
  Mission recording = second;
  recording.id = MissionId{make_uuid_v7(clock_.now())};
  recording.name = "still up";
  ASSERT_TRUE(s.missions.insert(recording));
  ASSERT_TRUE(s.missions.finish(second.id, clock_.now()));
  auto unseen = s.anchors.find_or_create(NetworkId{0x7fff}, clock_.now()).value();
  unseen.site = mission.site;
  unseen.name = "spare";
  ASSERT_TRUE(s.anchors.update(unseen, unseen.version));
  const auto answer = get("/api/v1/sites/" + to_string(*mission.site) + "/bundle");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const auto bytes = text(answer);

  OtherServer other;
  const auto taken = other.take(bytes);
  ASSERT_EQ(taken.status, 201) << taken.body;
  EXPECT_EQ(header(taken, "Location"), "/api/v1/sites/" + to_string(*mission.site));
  ASSERT_EQ(json(taken)["flights"].size(), 2u);
  EXPECT_EQ(json(taken)["flights"][0]["mission"], to_string(id_)) << "oldest first";
  EXPECT_EQ(rows_of(other.stores(), id_).tables, rows_of(s, id_).tables);
  EXPECT_EQ(rows_of(other.stores(), second.id).tables, rows_of(s, second.id).tables);
  EXPECT_FALSE(other.stores().missions.mission(recording.id));
  const auto found = other.stores().anchors.find_or_create(NetworkId{0x7fff}, clock_.now()).value();
  EXPECT_EQ(found.id, unseen.id);
  EXPECT_EQ(found.name, "spare");
  auto entries = entries_of(bytes);
  const Json left_out = json_of(content(entries, "manifest.json"))["left_out"];
  ASSERT_EQ(left_out.size(), 1u);
  EXPECT_EQ(left_out[0]["mission"], to_string(recording.id));

  const auto again = other.take(bytes);
  EXPECT_EQ(again.status, 200) << again.body;
  EXPECT_EQ(json(again)["already"], true);
  // What another server has with other content is named; the rest of the site stands there.
  OtherServer third;
  auto other_flight = mission;
  other_flight.site.reset();
  other_flight.state = MissionState::recording;
  ASSERT_TRUE(third.stores().missions.insert(other_flight));
  ASSERT_TRUE(third.stores().missions.finish(id_, clock_.now()));
  const auto refused = third.take(bytes);
  EXPECT_EQ(refused.status, 409) << refused.body;
  EXPECT_NE(refused.body.find("mission " + to_string(id_)), std::string::npos) << refused.body;
  EXPECT_TRUE(third.stores().missions.mission(second.id));
}

TEST_F(Bundles, OfASiteAreRefusedWholeWhereAnyPartIsNotWhatItSays) {
  const auto site = *database_->stores().missions.mission(id_).value().site;
  const auto good = entries_of(text(get("/api/v1/sites/" + to_string(site) + "/bundle")));
  const std::string flight = "missions/" + to_string(id_) + ".anchord";
  const auto refused = [&](Entries entries, const std::string& why) {
    OtherServer other;
    const auto answer = other.take(zip_of(entries));
    EXPECT_EQ(answer.status, 422) << why << answer.body;
    EXPECT_NE(answer.body.find(why), std::string::npos) << answer.body;
    expect_nothing(other);
  };
  const auto say_site_again = [](Entries& entries) {
    auto manifest = api::read_site_manifest(content(entries, "manifest.json")).value();
    for (auto& entry : manifest.entries) {
      Sha256 sum;
      sum.add(content(entries, entry.name));
      entry.bytes = content(entries, entry.name).size();
      entry.sha256_hex = sum.hex();
    }
    content(entries, "manifest.json") = api::write_site_manifest(manifest);
  };
  auto changed = good;
  content(changed, flight)[100] ^= 1;
  refused(changed, "does not have the digest");
  say_site_again(changed);  // as a forger would: the flight's own digests still tell
  refused(changed, flight);
  auto nonsense = good;
  content(nonsense, flight) = "no zip file";
  say_site_again(nonsense);
  refused(nonsense, flight);
  auto missing = good;
  std::erase_if(missing, [](const auto& e) { return e.first == "tables/plan.ndjson"; });
  refused(missing, "tables/plan.ndjson is missing");
  auto other_site = good;
  std::string& rows = content(other_site, "tables/site.ndjson");
  rows.replace(rows.find(to_string(site)), 36, "01a211df-8b78-77ea-8dc4-df6596c7fea9");
  say_site_again(other_site);
  refused(other_site, "no row of its site");
}

TEST_F(Bundles, AreAllOrNothing) {
  OtherServer other;
  // The last table but the revisions: everything before it was in the transaction already.
  const auto refused = other.take(forged("calibration_evidence", "[\"", "[\"0"));
  EXPECT_EQ(refused.status, 422) << refused.body;
  expect_nothing(other);
  const auto nobody = other.take(forged("estimate", "\"" + to_string(calibration_), "\"" + to_string(id_)));
  EXPECT_EQ(nobody.status, 409) << "its calibration is nowhere: " << nobody.body;
  expect_nothing(other);
}

TEST_F(Bundles, ThatWereTamperedWithAreSeen) {
  OtherServer other;
  const auto good = entries_of(bundle());
  const auto refused = [&](const Entries& entries, const std::string& what) {
    const auto answer = other.take(zip_of(entries));
    EXPECT_EQ(answer.status, 422) << answer.body;
    EXPECT_NE(answer.body.find(what), std::string::npos) << what << " in " << answer.body;
    expect_nothing(other);
  };
  auto changed = good;
  content(changed, "tables/fix.ndjson").back() = ' ';
  refused(changed, "tables/fix.ndjson does not have the digest");
  auto longer = good;
  content(longer, "tables/fix.ndjson") += "\n";
  refused(longer, "tables/fix.ndjson has");
  auto missing = good;
  std::erase_if(missing, [](const auto& e) { return e.first == "tables/fix.ndjson"; });
  refused(missing, "tables/fix.ndjson is missing");
  auto extra = good;
  extra.emplace_back("tables/token.ndjson", "[]\n");
  refused(extra, "tables/token.ndjson is not in the manifest");
  auto bare = good;
  std::erase_if(bare, [](const auto& e) { return e.first == "manifest.json"; });
  refused(bare, "no manifest.json");
  auto renamed = good;
  auto& manifest = content(renamed, "manifest.json");
  manifest.replace(manifest.find("fix.ndjson"), 3, "fax");
  refused(renamed, "digest");
  EXPECT_EQ(other.take(zip_of(good)).status, 201) << "the builder of this test makes good ones too";
}

TEST_F(Bundles, OfAForgerReachNoOtherTableAndNoOtherFlight) {
  OtherServer other;
  auto extra = entries_of(bundle());
  auto manifest = api::read_bundle_manifest(content(extra, "manifest.json")).value();
  extra.emplace_back("tables/token.ndjson", "[\"id\"]\n");
  manifest.entries.push_back({"tables/token.ndjson", 0, 0, ""});
  content(extra, "manifest.json") = api::write_bundle_manifest(manifest);
  say_again(extra);
  EXPECT_EQ(other.take(zip_of(extra)).status, 422);
  auto columns = entries_of(bundle());
  auto& text = content(columns, "tables/site.ndjson");
  text.replace(text.find("\"name\""), 6, "\"name) --\"");
  say_again(columns);
  EXPECT_EQ(other.take(zip_of(columns)).status, 422) << "columns are those of this program";
  const std::string stranger = "0197b0ff-0000-7000-8000-000000000000";
  EXPECT_EQ(other.take(forged("mission", to_string(id_), stranger)).status, 422) << "a row of another flight";
  expect_nothing(other);
}

TEST_F(Bundles, OfHostileBytesAreRefusedInWords) {
  for (const std::string& bytes :
       {std::string("x"), std::string("PK\x05\x06"), ZipBuilder().add("../manifest.json", "{}").bytes(),
        ZipBuilder().add("manifest.json", "{}").bytes(), ZipBuilder().add("manifest.json", "\xFF").bytes(),
        ZipBuilder().add("manifest.json", R"({"format":"anchord-bundle","version":1,"entries":5})").bytes(),
        ZipBuilder().add("manifest.json", R"({"format":"anchord-bundle","version":1e999})").bytes(),
        ZipBuilder().add({"a", std::string(std::size_t{32} << 20, '\0'), true}).bytes()}) {
    const auto answer = post("/api/v1/bundles", bytes, "application/zip");
    EXPECT_EQ(answer.status, 422) << answer.body;
    EXPECT_NE(answer.body.find("Nothing was imported"), std::string::npos) << answer.body;
  }
  Call empty;
  empty.headers["content-type"] = "application/zip";
  EXPECT_EQ(call(Method::post, "/api/v1/bundles", "", empty).status, 422);
  EXPECT_EQ(post("/api/v1/bundles", "{}", "application/json").status, 415);
  const auto newer = ZipBuilder().add("manifest.json", R"({"format":"anchord-bundle","version":2})").bytes();
  EXPECT_NE(post("/api/v1/bundles", newer, "application/zip").body.find("version 2"), std::string::npos);
}

TEST_F(Bundles, AreOfFinishedFlightsAndForEngineers) {
  const auto records = mission();
  EXPECT_EQ(get("/api/v1/missions/" + records + "/bundle").status, 409);
  EXPECT_EQ(get("/api/v1/missions/0197b0ff-0000-7000-8000-000000000000/bundle").status, 404);
  Call viewer;
  viewer.roles = {api::Role::viewer};
  viewer.type = "application/zip";
  const auto read = call(Method::get, path("/bundle"), "", viewer);
  ASSERT_EQ(read.status, 200);
  const auto bytes = text(read);
  for (const auto& [name, content] : entries_of(bytes))
    EXPECT_NE(name, "notes/audit.ndjson") << "who may not read the audit log";
  EXPECT_EQ(call(Method::post, "/api/v1/bundles", bytes, viewer).status, 403);
}

TEST_F(Bundles, LeaveOutRevisionsWhereThisServerPublishedOthers) {
  OtherServer other;
  const auto own = other.get("/api/v1/revisions");
  ASSERT_EQ(own.status, 200);
  ASSERT_EQ(other.take(bundle()).status, 201);
  // It publishes for itself; a later bundle, with a second revision, does not overrule it.
  const auto theirs = other.stores().calibrations.calibration(calibration_).value();
  ASSERT_TRUE(
      other.stores().revisions.publish(calibration_, {theirs.anchors[1].anchor}, "other", "", clock_.now()));
  ASSERT_TRUE(
      other.stores().revisions.publish(calibration_, {theirs.anchors[2].anchor}, "other", "", clock_.now()));
  const auto later = solved(*this, to_string(id_));
  const auto anchors = database_->stores().calibrations.calibration(later).value().anchors;
  ASSERT_TRUE(database_->stores().revisions.publish(later, {anchors[1].anchor}, "tester", "", clock_.now()));
  const auto answer = other.take(bundle());
  ASSERT_EQ(answer.status, 201) << answer.body;
  EXPECT_NE(json(answer)["left_out"].dump().find("revision 2"), std::string::npos) << answer.body;
  EXPECT_EQ(other.stores().revisions.revisions(10, 0).value().size(), 3u);
}

TEST_F(Bundles, LeaveOutACalibrationMadeWithAFlightThatIsNotHere) {
  const auto second = mission();
  Calibration both = database_->stores().calibrations.calibration(calibration_).value();
  both.id = CalibrationId{make_uuid_v7(clock_.now())};
  both.missions.push_back(MissionId{parse_uuid(second).value()});
  ASSERT_TRUE(database_->stores().calibrations.insert(both));
  OtherServer other;
  const auto answer = other.take(bundle());
  ASSERT_EQ(answer.status, 201) << answer.body;
  EXPECT_NE(json(answer)["left_out"].dump().find(to_string(both.id)), std::string::npos) << answer.body;
  EXPECT_TRUE(other.stores().calibrations.calibration(calibration_));
  EXPECT_FALSE(other.stores().calibrations.calibration(both.id));
}

TEST_F(Bundles, HaveEveryColumnThatIsNoKeyOfThisDatabase) {
  // A column that a migration adds must come along, or be named here with its reason.
  const std::set<std::string> local{"mission_key",   "range_id",        "fix_id",
                                    "exclusion_key", "calibration_key", "model_key",
                                    "run_key",     // training runs stay where they ran
                                    "signature"};  // what this server says of a model is its own word
  sqlite3* file = nullptr;
  ASSERT_EQ(sqlite3_open_v2((dir_ / "data" / "anchord.db").c_str(), &file, SQLITE_OPEN_READONLY, nullptr),
            SQLITE_OK);
  for (const auto& table : database_->stores().bundles.tables()) {
    std::set<std::string> carried;
    for (const auto& column : table.columns) carried.insert(column.name);
    sqlite3_stmt* columns = nullptr;
    ASSERT_EQ(
        sqlite3_prepare_v2(file, ("PRAGMA table_info(" + table.name + ")").c_str(), -1, &columns, nullptr),
        SQLITE_OK);
    std::size_t n = 0;
    for (; sqlite3_step(columns) == SQLITE_ROW; ++n) {
      const std::string name = reinterpret_cast<const char*>(sqlite3_column_text(columns, 1));
      EXPECT_TRUE(carried.contains(name) || local.contains(name)) << table.name << "." << name;
    }
    EXPECT_GT(n, 0u) << table.name;
    sqlite3_finalize(columns);
  }
  sqlite3_close(file);
}

TEST_F(Bundles, AreHandedOverInAPackThatItsSignatureCovers) {
  const auto answer = get(path("/handover"));
  ASSERT_EQ(answer.status, 200) << answer.body;
  const auto bytes = text(answer);
  auto entries = entries_of(bytes);
  const auto contents = json_of(content(entries, "contents.json"));
  EXPECT_EQ(contents["calibration"], to_string(calibration_)) << contents;
  for (const char* name : {"bundle.anchord", "report.html", "anchors.geojson", "anchors.gpkg", "SHA256SUMS"})
    EXPECT_FALSE(content(entries, name).empty()) << name;
  EXPECT_EQ(json_of(content(entries, "anchors.geojson"))["features"].size(), 1u) << "what is published of it";
  // Of a site without a map system there is no drawing, and the pack says so.
  EXPECT_NE(contents["left_out"].dump().find("anchors.dxf"), std::string::npos) << contents;
  EXPECT_NE(contents["left_out"].dump().find("nothing prints here"), std::string::npos) << contents;
  const auto key = json(get("/api/v1/signing-key"));
  EXPECT_EQ(get("/api/v1/signing-key", {{"format", "pem"}}).body, key["public_key"]);
  const auto known = Ed25519Public::parse_pem(key["public_key"].get<std::string>()).value();
  EXPECT_TRUE(known.verifies(content(entries, "SHA256SUMS"), content(entries, "SHA256SUMS.sig")));
  const auto file = dir_ / "pack.zip";
  std::ofstream(file, std::ios::binary) << bytes;
  const auto verdict = api::verify_pack(file, known);
  ASSERT_TRUE(verdict) << verdict.error().message;
  EXPECT_TRUE(verdict.value().faults.empty()) << verdict.value().faults.front();
  content(entries, "report.html") += "<!-- changed -->";
  std::ofstream(file, std::ios::binary) << zip_of(entries);
  EXPECT_EQ(api::verify_pack(file, known).value().faults.size(), 1u);
  OtherServer other;
  EXPECT_EQ(other.take(content(entries, "bundle.anchord")).status, 201)
      << "the bundle in it is one to import";
}

TEST_F(Bundles, HaveThePrintedReportInTheirPackWhereTheMachinePrintsOne) {
  prints_ = true;
  auto entries = entries_of(text(get(path("/handover"))));
  const std::string html = content(entries, "report.html"), pdf = content(entries, "report.pdf");
  EXPECT_EQ(pdf, "%PDF-1.7 of " + std::to_string(html.size())) << "what was printed is the report";
  EXPECT_NE(content(entries, "SHA256SUMS").find("  report.pdf\n"), std::string::npos)
      << "signed with the rest";
}

TEST_F(Bundles, LeaveNothingBehindInTheSpoolFolder) {
  bundle();
  post("/api/v1/bundles", "no zip", "application/zip");
  get(path("/handover"));
  std::size_t n = 0;
  for ([[maybe_unused]] const auto& left : std::filesystem::directory_iterator(dir_ / "spool")) ++n;
  EXPECT_EQ(n, 0u);
}

}  // namespace
}  // namespace anchord::test
