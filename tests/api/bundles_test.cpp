// A flight leaves one server as a file and stands on another as it was: the same ids, rows and anchors; all
// or nothing; whatever is not what the manifest says is refused. And the signed pack that is handed over.
#include "bundles_fixture.hpp"
#include "core/ports/procedure_log.hpp"

namespace anchord::test::bundles_test {
namespace {

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

TEST_F(Bundles, CarryWhatTheProcedureShowedAndHaveNoEntryOfItWhereItShowedNothing) {
  const auto without = bundle();
  EXPECT_EQ(without.find("procedure_log"), std::string::npos)
      << "a server from before there was one takes it";
  const ProcedureEntry entry{clock_.now(), "mission.grid", R"({"chosen":0})"};
  ASSERT_TRUE(database_->stores().procedure_log.append(id_, std::vector{entry, entry}));
  OtherServer other;
  EXPECT_EQ(other.take(without).status, 201);
  EXPECT_TRUE(other.stores().procedure_log.entries(id_, 10, 0).value().empty());
  const auto taken = other.take(bundle());
  ASSERT_EQ(taken.status, 201) << taken.body;
  EXPECT_EQ(json(taken)["added"], Json({{"procedure_log", 2}}));
  const auto there = other.stores().procedure_log.entries(id_, 10, 1).value();
  ASSERT_EQ(there.size(), 1u);
  EXPECT_EQ(there[0].entry.message_json, entry.message_json);
  EXPECT_EQ(json(other.take(bundle()))["already"], true);
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
  const auto measured = post("/api/v1/bundles", forged("uwb_range", "\n[0,", "\n[1,"), "application/zip");
  EXPECT_EQ(measured.status, 409) << measured.body;
  EXPECT_NE(measured.body.find(to_string(id_)), std::string::npos) << measured.body;
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
  const std::set<std::string> local{"mission_key",     "range_id",        "fix_id",
                                    "exclusion_key",   "calibration_key", "model_key",
                                    "run_key",          // training runs stay where they ran
                                    "organization_id",  // whose site it is here, an administrator says
                                    "signature"};       // what this server says of a model is its own word
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
}  // namespace anchord::test::bundles_test
