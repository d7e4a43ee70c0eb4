// A site leaves one server as a file with all its flights and stands on another; the events of a flight come
// along.
#include "bundles_fixture.hpp"

namespace anchord::test::site_bundles_test {
namespace {

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
  const auto file = dir_ / "site.anchord";
  std::ofstream(file, std::ios::binary) << bytes;
  EXPECT_TRUE(api::verify_pack(file, std::nullopt).value().faults.empty()) << "it is whole";

  const auto again = other.take(bytes);
  EXPECT_EQ(again.status, 200) << again.body;
  EXPECT_EQ(json(again)["already"], true);
  // What another server has with other content is named; the rest of the site stands there.
  OtherServer third;
  auto other_flight = mission;
  other_flight.site.reset();
  other_flight.created.ns += 1;
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
  refused(other_site, "is of another one");
  rows.erase(rows.find('\n') + 1);  // but the names of the columns
  say_site_again(other_site);
  refused(other_site, "no row of its site");
}

// A row that the database took and no reader could read again made lists fail for everybody.
TEST_F(Bundles, WithRowsThatNobodyCouldReadAgainAreRefusedByLineAndColumn) {
  const auto refused = [](const std::string& bundle, const std::string& why) {
    OtherServer other;
    const auto answer = other.take(bundle);
    EXPECT_EQ(answer.status, 422) << why << answer.body;
    EXPECT_NE(answer.body.find(why), std::string::npos) << answer.body;
    expect_nothing(other);
    for (const char* list : {"/api/v1/plans", "/api/v1/sites", "/api/v1/calibrations"})
      EXPECT_EQ(other.get(list).status, 200) << list;
  };
  const auto site = *database_->stores().missions.mission(id_).value().site;
  const auto plan = post("/api/v1/plans", Json{{"name", "South"}, {"site", to_string(site)}}.dump());
  ASSERT_EQ(plan.status, 201) << plan.body;
  const auto of_site = [&](const std::string& table, const std::string& from, const std::string& to) {
    auto entries = entries_of(text(get("/api/v1/sites/" + to_string(site) + "/bundle")));
    std::string& rows = content(entries, "tables/" + table + ".ndjson");
    const auto at = rows.find(from, rows.find('\n'));
    EXPECT_NE(at, std::string::npos) << from << " in " << rows;
    rows.replace(at, from.size(), to);
    auto manifest = api::read_site_manifest(content(entries, "manifest.json")).value();
    for (auto& entry : manifest.entries) {
      Sha256 sum;
      sum.add(content(entries, entry.name));
      entry.bytes = content(entries, entry.name).size();
      entry.sha256_hex = sum.hex();
    }
    content(entries, "manifest.json") = api::write_site_manifest(manifest);
    return zip_of(entries);
  };
  const std::string name = R"(\"name\":)";
  refused(of_site("plan", name, R"(\"nme\":)"), "tables/plan.ndjson line 2: document_json is no plan");
  refused(of_site("plan", name, R"(\"name\")"), "document_json is not JSON");
  refused(of_site("plan", name, R"(\"\u0000\":)"), "has a character 0");
  const double lat_deg = database_->stores().sites.site(site).value().origin->lat_deg;
  refused(of_site("site", Json(lat_deg).dump(), "1e308"), "origin_lat_deg is not within -90 and 90");
}

// The same door as REST: what POST /missions, /ranges, /fixes and the others refuse comes in by no bundle.
TEST_F(Bundles, WithValuesThatRestRefusesAreRefusedByLineAndColumn) {
  OtherServer other;
  const auto refused = [&](const std::string& table, const std::string& column, const Json& value) {
    const auto answer = other.take(with_cell(table, column, value));
    EXPECT_EQ(answer.status, 422) << table << ' ' << column << ' ' << value << ' ' << answer.body;
    const auto at = answer.body.find("tables/" + table + ".ndjson line 2: ");
    EXPECT_NE(at, std::string::npos) << answer.body;
    EXPECT_NE(answer.body.find(column, std::min(at, answer.body.size())), std::string::npos) << answer.body;
  };
  for (const std::string odd : {"a\nb", "a\rb", "a\tb", "a\x1b[2J", "a\x01"}) {
    refused("mission", "name", odd);
    refused("mission", "kit", odd);
    refused("site", "name", odd);
    refused("anchor", "name", odd);
    refused("anchor", "asset_tag", odd);
    refused("exclusion", "reason", odd);
    refused("revision", "note", odd);
  }
  for (const char* table : {"mission", "site"}) refused(table, "name", "   ");
  refused("mission", "name", std::string(201, 'n'));
  refused("anchor", "building", std::string(5000, 'n'));
  refused("site", "base_source", "hearsay");
  refused("site", "crs_epoch_year", 3000.5);
  refused("site", "origin_height_m", 1e9);
  refused("site", "outline_geojson", R"({"type":"Point","coordinates":[1,2]})");
  for (const int state : {0, 1}) refused("mission", "state", state);
  for (const double arm_m : {1e9, -101.0}) refused("mission_tag", "lever_arm_up_m", arm_m);
  for (const double distance_m : {-5.0, 0.0, 1e9}) refused("uwb_range", "distance_m", distance_m);
  for (const std::int64_t id : {std::int64_t{99'999'999'999}, std::int64_t{-1}, std::int64_t{1} << 32}) {
    refused("uwb_range", "anchor", id);
    refused("uwb_range", "tag", id);
    refused("anchor", "network_id", id);
    refused("mission_tag", "tag", id);
  }
  for (const std::int64_t t_ns : {std::int64_t{-5}, INT64_MAX}) {
    refused("uwb_range", "t_ns", t_ns);
    refused("fix", "t_ns", t_ns);
    refused("mission", "created_t_ns", t_ns);
  }
  refused("uwb_range", "antenna", 256);
  refused("uwb_range", "rx_dbm", -999.0);
  refused("fix", "lat_deg", nullptr);
  refused("fix", "height_m", 1e9);
  refused("fix", "satellites", -1);
  refused("fix", "cov_ee_m2", -1.0);
  refused("fix", "enu_from_body_w", 3.5);
  for (const char* column : {"h95_m", "v95_m", "gdop", "bias_sigma_m"}) refused("estimate", column, -3.0);
  refused("hypothesis", "probability", 1.5);
  expect_nothing(other);
  EXPECT_EQ(other.take(bundle()).status, 201) << "what this server says itself";
}

TEST_F(Bundles, OfNamesOfManyBytesAndOfRowsThatOnlyDevicesSendAreTaken) {
  const auto taken = [&](const std::string& table, const std::string& column, const Json& value) {
    OtherServer other;
    const auto answer = other.take(with_cell(table, column, value));
    EXPECT_EQ(answer.status, 201) << table << ' ' << column << ' ' << value << ' ' << answer.body;
  };
  std::string emoji;
  for (int i = 0; i < 200; ++i) emoji += "\xf0\x9f\x9b\xb0";
  taken("mission", "name", emoji);
  taken("uwb_range", "distance_m", 420.5);  // a Pozyx radio
  taken("fix", "correction_age_s", nullptr);
}

TEST_F(Bundles, OfAPlanThatIsSpoiledInTheDatabaseLeaveListsAndTheWayOutOpen) {
  const auto made = post("/api/v1/plans", R"({"name":"South"})");
  ASSERT_EQ(made.status, 201) << made.body;
  const std::string id = json(made)["id"];
  {
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open((dir_ / "data" / "anchord.db").c_str(), &db), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(db, "UPDATE plan SET document_json = '{'", nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(db);
  }
  const auto list = get("/api/v1/plans");
  ASSERT_EQ(list.status, 200) << list.body;
  EXPECT_EQ(json(list)["items"][0]["name"], "South (its document cannot be read)");
  Call options;
  options.headers["if-match"] = header(get("/api/v1/plans/" + id), "ETag");
  EXPECT_EQ(call(Method::del, "/api/v1/plans/" + id, "", options).status, 204);
}

}  // namespace
}  // namespace anchord::test::site_bundles_test
