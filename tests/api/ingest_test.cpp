// POST /ranges and /fixes: every kind of bad input has one named test, and good rows beside it are kept.
#include "api/measurements/flight_requests.hpp"
#include "app_fixture.hpp"
#include "core/ports/measurement_store.hpp"

namespace anchord::test::ingest_test {
namespace {

using api::Method;

class Ingest : public AppFixture {
 protected:
  void SetUp() override {
    AppFixture::SetUp();
    id_ = mission();
  }
  std::string row(int i, const std::string& more = "") const {
    return R"({"t_us":)" + std::to_string(1'777'889'472'000'000 + i * 1000) + R"(,"mission":")" + id_ +
           R"(","tag":"0x6e01","anchor":"0x6a2f","distance_m":7.5)" + more + "}";
  }
  std::string fix(int i, const std::string& place = R"("lon":3.7131,"lat":51.0231,"h_m":61.4)") const {
    return R"({"t_us":)" + std::to_string(1'777'889'472'000'000 + i * 1000) + R"(,"mission":")" + id_ +
           R"(",)" + place + R"(,"fix":"fixed","sigma_m":[0.01,0.01,0.02]})";
  }
  std::uint64_t stored() {
    return database_->stores().measurements.count_ranges(MissionId{parse_uuid(id_).value()}).value();
  }
  /// A good row, the bad one, a good row; the code of the bad one.
  std::string code_of(const std::string& bad, const std::string& pointer = "?") {
    const auto response =
        post("/api/v1/ranges", row(1) + "\n" + bad + "\n" + row(2) + "\n", "application/x-ndjson");
    EXPECT_EQ(response.status, 200) << response.body;
    const auto body = json(response);
    EXPECT_EQ(body["accepted"].get<int>() + body["duplicates"].get<int>(), 2) << response.body;
    EXPECT_EQ(body["rejected"], 1);
    EXPECT_EQ(stored(), 2u) << "good lines beside a bad one are kept, the bad one is not";
    if (body["errors"].empty()) return "none";
    EXPECT_EQ(body["errors"][0]["line"], 2);
    if (pointer != "?") {
      EXPECT_EQ(body["errors"][0]["pointer"], pointer);
    }
    return body["errors"][0]["code"];
  }
  std::string with(const std::string& from, const std::string& to) const {
    std::string text = row(9);
    return text.replace(text.find(from), from.size(), to);
  }
  std::string id_;
};

TEST_F(Ingest, TakesOneJsonObject) {
  const auto response = post("/api/v1/ranges", row(1));
  EXPECT_EQ(response.status, 200) << response.body;
  EXPECT_EQ(json(response)["accepted"], 1);
}
TEST_F(Ingest, TakesAJsonArray) {
  EXPECT_EQ(json(post("/api/v1/ranges", "[" + row(1) + "," + row(2) + "]"))["accepted"], 2);
}
TEST_F(Ingest, TakesNdjsonWithBlankAndCrlfLines) {
  EXPECT_EQ(json(post("/api/v1/ranges", row(1) + "\r\n\r\n" + row(2), "application/x-ndjson"))["accepted"],
            2);
}
TEST_F(Ingest, TakesCsvOfRangesAndFixes) {
  const auto ranges = post("/api/v1/ranges",
                           "t_us,tag,anchor,distance_m,rss_dbm\n1777889472000000,0x6e01,0x6a2f,7.5,-"
                           "80\n1777889472001000,28161,27183,7.6,\n",
                           "text/csv; charset=utf-8", {{"mission", id_}});
  EXPECT_EQ(json(ranges)["accepted"], 2) << ranges.body;
  const auto fixes = post("/api/v1/fixes",
                          "t_us,lon,lat,h_m,fix,sigma_e_m,sigma_n_m,sigma_u_m\n1777889472000000,3.7,51.0,61."
                          "4,fixed,0.01,0.01,0.02\n",
                          "text/csv", {{"mission", id_}});
  EXPECT_EQ(json(fixes)["accepted"], 1) << fixes.body;
}
TEST_F(Ingest, RefusesAnUnknownCsvColumn) {
  EXPECT_EQ(post("/api/v1/ranges", "t_us,tag,anchor,distance\n", "text/csv", {{"mission", id_}}).status, 422);
}
TEST_F(Ingest, RefusesNanInCsv) {
  const auto response =
      post("/api/v1/ranges", "t_us,tag,anchor,distance_m\n1777889472000000,0x6e01,0x6a2f,NaN\n", "text/csv",
           {{"mission", id_}});
  EXPECT_EQ(json(response)["errors"][0]["code"], "non_finite") << response.body;
}
TEST_F(Ingest, RefusesNan) { EXPECT_EQ(code_of(with("7.5", "NaN")), "non_finite"); }
TEST_F(Ingest, RefusesInfinity) { EXPECT_EQ(code_of(with("7.5", "Infinity")), "non_finite"); }
TEST_F(Ingest, RefusesAHugeNumber) { EXPECT_EQ(code_of(with("7.5", "1e999")), "non_finite"); }
TEST_F(Ingest, RefusesZeroDistanceByName) {
  EXPECT_EQ(code_of(with("7.5", "0"), "/distance_m"), "zero_distance");
}
TEST_F(Ingest, RefusesDistancesNoRadioMeasures) {
  EXPECT_EQ(code_of(with("7.5", "150.01"), "/distance_m"), "out_of_range");
  EXPECT_EQ(code_of(with("7.5", "0.049"), "/distance_m"), "out_of_range");
  EXPECT_EQ(code_of(with("7.5", "-3"), "/distance_m"), "out_of_range");
}
TEST_F(Ingest, RefusesAnUnknownField) {
  EXPECT_EQ(code_of(row(9, R"(,"distanze_m":7)"), "/distanze_m"), "unknown_field");
}
TEST_F(Ingest, RefusesARepeatedKey) {
  EXPECT_EQ(code_of(row(9, R"(,"tag":"0x1")"), "/tag"), "duplicate_key");
}
TEST_F(Ingest, RefusesBrokenUtf8) { EXPECT_EQ(code_of(row(9, ",\"heading_deg\":\"\xc3\x28\"")), "bad_utf8"); }
TEST_F(Ingest, RefusesDeepJson) {
  std::string deep;
  for (int i = 0; i < 40; ++i) deep += '[';
  EXPECT_EQ(code_of(row(9, R"(,"truth":)" + deep)), "too_deep");
}
TEST_F(Ingest, RefusesATruncatedLine) { EXPECT_EQ(code_of(row(9).substr(0, 40)), "malformed"); }
TEST_F(Ingest, RefusesAnUnknownMission) {
  EXPECT_EQ(code_of(with(id_, "0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"), "/mission"), "unknown_mission");
}
TEST_F(Ingest, RefusesAMissingField) {
  EXPECT_EQ(code_of(with(R"(,"distance_m":7.5)", ""), "/distance_m"), "required");
}
TEST_F(Ingest, RefusesABadNetworkId) {
  EXPECT_EQ(code_of(with("0x6a2f", "anchor one"), "/anchor"), "bad_id");
}
TEST_F(Ingest, RefusesARadioThatMeasuresToItself) {
  EXPECT_EQ(code_of(with("0x6a2f", "0x6e01"), "/anchor"), "same_device");
}
TEST_F(Ingest, ReadsMediaTypesWithoutRegardToCase) {
  EXPECT_EQ(post("/api/v1/ranges", row(77), "Application/X-NDJSON; Charset=UTF-8").status, 200);
}
TEST_F(Ingest, RefusesALineThatIsTooLong) {
  EXPECT_EQ(code_of("{\"x\":\"" + std::string(2 << 20, 'a') + "\"}"), "too_long");
}

TEST_F(Ingest, AnswersASingleBadObjectWithEveryFieldAtOnce) {
  const auto response = post(
      "/api/v1/ranges", R"({"t_us":-1,"tag":"x","anchor":"0x1","distance_m":0,"mission":")" + id_ + R"("})");
  EXPECT_EQ(response.status, 422);
  EXPECT_EQ(header(response, "Content-Type"), "application/problem+json");
  EXPECT_EQ(json(response)["errors"].size(), 3u) << response.body;
}
TEST_F(Ingest, AnswersABrokenDocumentWith400AndStoresNothing) {
  EXPECT_EQ(post("/api/v1/ranges", "[" + row(1) + "," + row(2).substr(0, 30) + "]").status, 400);
  EXPECT_EQ(post("/api/v1/ranges", "{\"t_us\":").status, 400);
  EXPECT_EQ(stored(), 0u);
}
TEST_F(Ingest, CountsDuplicatesAndKeepsTheStoredRowOnConflict) {
  post("/api/v1/ranges", row(1, R"(,"seq":5)"));
  const auto again = post("/api/v1/ranges", row(1, R"(,"seq":5)"));
  EXPECT_EQ(json(again)["duplicates"], 1) << again.body;
  std::string other = row(1, R"(,"seq":5)");
  other.replace(other.find("7.5"), 3, "8.5");
  EXPECT_EQ(post("/api/v1/ranges", other).status, 409);
  const auto lines = post("/api/v1/ranges", other + "\n" + row(2), "application/x-ndjson");
  EXPECT_EQ(lines.status, 200);
  EXPECT_EQ(json(lines)["errors"][0]["code"], "conflict") << lines.body;
  EXPECT_EQ(json(get("/api/v1/ranges"))["items"][0]["distance_m"], 7.5);
}
TEST_F(Ingest, TakesRowsOutOfOrder) {
  EXPECT_EQ(json(post("/api/v1/ranges", row(5) + "\n" + row(1) + "\n" + row(3),
                      "application/x-ndjson"))["accepted"],
            3);
}
TEST_F(Ingest, StoresNothingWhenAtomicAndOneRowIsBad) {
  const auto response =
      post("/api/v1/ranges", row(1) + "\n" + with("7.5", "0"), "application/x-ndjson", {{"atomic", "true"}});
  EXPECT_EQ(response.status, 422) << response.body;
  EXPECT_EQ(stored(), 0u);
  EXPECT_EQ(
      post("/api/v1/ranges", row(1) + "\n" + row(2), "application/x-ndjson", {{"atomic", "true"}}).status,
      200);
  EXPECT_EQ(stored(), 2u);
}
TEST_F(Ingest, StoresNothingOnADryRun) {
  const auto response =
      post("/api/v1/ranges", row(1) + "\n" + with("7.5", "0"), "application/x-ndjson", {{"dry_run", "true"}});
  EXPECT_EQ(json(response)["accepted"], 1);
  EXPECT_EQ(json(response)["rejected"], 1);
  EXPECT_EQ(stored(), 0u);
}
TEST_F(Ingest, ListsTheFirstHundredErrorsAndSaysThereAreMore) {
  std::string body;
  for (int i = 0; i < 150; ++i) body += with("7.5", "0") + "\n";
  const auto response = json(post("/api/v1/ranges", body, "application/x-ndjson"));
  EXPECT_EQ(response["rejected"], 150);
  EXPECT_EQ(response["errors"].size(), 100u);
  EXPECT_EQ(response["errors_truncated"], true);
}
TEST_F(Ingest, AnswersRowsThatAreAllWrongWith422AndTheSameReport) {
  const std::string bad = with("7.5", "0");
  const auto check = [&](const api::Response& response, int n) {
    EXPECT_EQ(response.status, 422) << response.body;
    EXPECT_EQ(header(response, "Content-Type"), "application/problem+json");
    const auto body = json(response);
    EXPECT_EQ(body["type"], "/problems/validation");
    EXPECT_EQ(body["status"], 422);
    EXPECT_EQ(body["accepted"], 0);
    EXPECT_EQ(body["duplicates"], 0);
    EXPECT_EQ(body["rejected"], n);
    EXPECT_EQ(body["errors"][0]["line"], 1);
    EXPECT_EQ(body["errors"][0]["code"], "zero_distance");
    EXPECT_EQ(body["errors_truncated"], false);
    EXPECT_FALSE(body["instance"].get<std::string>().empty());
  };
  check(post("/api/v1/ranges", bad + "\n" + bad, "application/x-ndjson"), 2);
  check(post("/api/v1/ranges", bad, "application/x-ndjson"), 1);
  check(post("/api/v1/ranges", "[" + bad + "," + bad + "]"), 2);
  check(post("/api/v1/ranges", bad + "\n" + bad, "application/x-ndjson", {{"dry_run", "true"}}), 2);
  EXPECT_EQ(post("/api/v1/fixes", fix(1, R"("lon":0,"lat":0,"h_m":5)"), "application/x-ndjson").status, 422);
  EXPECT_EQ(stored(), 0u);
  // One that is taken, or known already, and it is what it was.
  EXPECT_EQ(post("/api/v1/ranges", bad + "\n" + row(1), "application/x-ndjson").status, 200);
  EXPECT_EQ(post("/api/v1/ranges", bad + "\n" + row(1), "application/x-ndjson").status, 200);
  EXPECT_EQ(post("/api/v1/ranges", "\n\n", "application/x-ndjson").status, 200) << "no rows, none wrong";
}
TEST_F(Ingest, ReadsTheReportOfRowsThatAreAllWrongAsItsOwnClient) {
  const auto response = post("/api/v1/ranges", with("7.5", "0"), "application/x-ndjson");
  const auto answer = api::parse_ingest_answer(response.body);
  ASSERT_TRUE(answer) << response.body;
  EXPECT_EQ(answer.value().rejected, 1u);
  EXPECT_TRUE(answer.value().first_error.starts_with("zero_distance: ")) << answer.value().first_error;
  EXPECT_FALSE(api::parse_ingest_answer(post("/api/v1/ranges", "{", "application/json").body));
}
TEST_F(Ingest, RefusesWrongAbsentAndCompressedContent) {
  EXPECT_EQ(post("/api/v1/ranges", row(1), "text/plain").status, 415);
  EXPECT_EQ(post("/api/v1/ranges", row(1), "").status, 415);
  Call gzip;
  gzip.headers["content-encoding"] = "gzip";
  EXPECT_EQ(call(Method::post, "/api/v1/ranges", row(1), gzip).status, 415);
}
TEST_F(Ingest, RefusesABodyBeyond32MiB) {
  std::string body;
  const std::string line = row(1) + std::string(900'000, ' ') + "\n";
  while (body.size() <= (33u << 20)) body += line;
  EXPECT_EQ(post("/api/v1/ranges", body, "application/x-ndjson").status, 413);
}
TEST_F(Ingest, RefusesAnUnknownMissionInTheQuery) {
  EXPECT_EQ(post("/api/v1/ranges", row(1), "application/json",
                 {{"mission", "0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"}})
                .status,
            404);
}
TEST_F(Ingest, RefusesFixesThatAreNowhere) {
  const auto code = [&](const std::string& place) {
    return json(post("/api/v1/fixes", fix(1, place), "application/x-ndjson"))["errors"][0]["code"]
        .get<std::string>();
  };
  EXPECT_EQ(code(R"("lon":0,"lat":0,"h_m":5)"), "null_island");
  EXPECT_EQ(code(R"("lon":3.7,"lat":90.5,"h_m":5)"), "out_of_range");
  EXPECT_EQ(code(R"("lon":181,"lat":51,"h_m":5)"), "out_of_range");
  EXPECT_EQ(code(R"("lon":3.7,"lat":51,"h_m":9001)"), "out_of_range");
  EXPECT_EQ(code(R"("lon":3.7,"lat":51,"h_m":-501)"), "out_of_range");
  EXPECT_EQ(code(R"("local_m":[1,2,3])"), "wrong_frame");
}
TEST_F(Ingest, SaysOfMapCoordinatesWhatToDoWithThem) {
  for (const char* place :
       {R"("lon":691650.4,"lat":5334754.2,"h_m":565)", R"("local_m":[691650.4,5334754.2,565])",
        R"("local_m":[4178000.1,855806.0,4727488.2])", R"("local_m":[530000,180000,50])"}) {
    const auto response = post("/api/v1/fixes", fix(1, place), "application/x-ndjson");
    EXPECT_EQ(response.status, 422) << place;
    const auto error = json(response)["errors"][0];
    EXPECT_EQ(error["code"], "out_of_range") << place;
    EXPECT_NE(error["detail"].get<std::string>().find("POST /api/v1/transform"), std::string::npos) << error;
  }
  const auto table = post("/api/v1/fixes", "t_us,x_m,y_m,z_m,fix\n1777889472000000,530000,180000,50,fixed\n",
                          "text/csv", {{"mission", id_}});
  EXPECT_EQ(table.status, 422) << table.body;
  EXPECT_NE(table.body.find("POST /api/v1/transform"), std::string::npos) << table.body;
}
TEST_F(Ingest, KeepsAFixWithoutRtk) {
  std::string body = fix(1);
  body.replace(body.find("fixed"), 5, "none");
  EXPECT_EQ(json(post("/api/v1/fixes", body))["accepted"], 1);
}
TEST_F(Ingest, KeepsTheImpulseResponseBitForBit) {
  post("/api/v1/ranges", row(1, R"(,"cir":{"n":2,"dt_ps":1001.6,"b64":"AAEAAv//AIA="})"));
  const auto id = json(get("/api/v1/ranges"))["items"][0]["id"].get<int>();
  const auto response = get("/api/v1/ranges/" + std::to_string(id) + "/cir", {{"format", "binary"}});
  EXPECT_EQ(response.body, std::string("\x00\x01\x00\x02\xff\xff\x00\x80", 8));
  EXPECT_EQ(json(post("/api/v1/ranges", row(2, R"(,"cir":{"n":3,"b64":"AAEAAv//AIA="})"),
                      "application/x-ndjson"))["errors"][0]["code"],
            "wrong_length");
}
TEST_F(Ingest, IsForGatewaysAndNotForViewers) {
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(Method::post, "/api/v1/ranges", row(1), viewer).status, 403);
  viewer.roles = {};
  EXPECT_EQ(call(Method::post, "/api/v1/ranges", row(1), viewer).status, 401);
  viewer.roles = {api::Role::gateway};
  EXPECT_EQ(call(Method::post, "/api/v1/ranges", row(1), viewer).status, 200);
  EXPECT_EQ(call(Method::get, "/api/v1/ranges", "", viewer).status, 403);
}
TEST_F(Ingest, GivesTheFieldsAskedForAndSaysWhichDoNotExist) {
  post("/api/v1/ranges", row(1), "application/json");
  const auto picked = get("/api/v1/ranges", {{"mission", id_}, {"fields", "anchor,fp_dbm,distance_m"}});
  const auto item = json(picked)["items"][0];
  EXPECT_TRUE(item.contains("anchor") && item.contains("distance_m"));
  EXPECT_EQ(item.size(), 2u) << "the row has no first-path power, which is not an error: " << item;
  const auto slip = get("/api/v1/ranges", {{"mission", id_}, {"fields", "anchor,distance"}});
  EXPECT_EQ(slip.status, 422);
  EXPECT_NE(text(slip).find("\\\"distance\\\""), std::string::npos) << text(slip);
  EXPECT_NE(text(slip).find("distance_m"), std::string::npos) << "names those that exist";
}
TEST_F(Ingest, ExportsWhatItTookAsCsvAndNdjson) {
  std::string body;
  for (int i = 0; i < 2500; ++i) body += row(i) + "\n";
  post("/api/v1/ranges", body, "application/x-ndjson");
  const auto csv = text(get("/api/v1/ranges", {{"format", "csv"}}));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 2501);
  const auto lines = text(get("/api/v1/ranges", {{"format", "ndjson"}, {"mission", id_}}));
  EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), 2500);
}
TEST_F(Ingest, AFlightThatIsNotThereIsNotFoundInEveryFormat) {
  for (const char* list : {"/api/v1/ranges", "/api/v1/fixes"})
    for (const char* format : {"json", "ndjson", "csv"}) {
      Call options;
      options.query = {{"mission", "0197b0ff-0000-7000-8000-000000000000"}, {"format", format}};
      EXPECT_EQ(call(Method::get, list, "", options).status, 404) << list << ' ' << format;
    }
}

TEST_F(Ingest, SaysAgainWhereTheCreatedThingIs) {
  Call options;
  options.headers["idempotency-key"] = "create-once";
  const std::string mission = R"({"name":"twice asked","frame":"wgs84","track_point":"body","tags":[]})";
  const auto first = call(Method::post, "/api/v1/missions", mission, options);
  const auto second = call(Method::post, "/api/v1/missions", mission, options);
  EXPECT_EQ(second.status, 201);
  EXPECT_TRUE(header(first, "Location").starts_with("/api/v1/missions/"));
  EXPECT_EQ(header(second, "Location"), header(first, "Location"));
  EXPECT_EQ(header(second, "ETag"), header(first, "ETag"));
}
TEST_F(Ingest, AnswersAnIdempotencyKeyOnce) {
  Call options;
  options.headers["idempotency-key"] = "k1";
  const auto first = call(Method::post, "/api/v1/ranges", row(1), options);
  const auto second = call(Method::post, "/api/v1/ranges", row(1), options);
  EXPECT_EQ(first.body, second.body);
  EXPECT_EQ(header(second, "Idempotent-Replayed"), "true");
  EXPECT_EQ(call(Method::post, "/api/v1/ranges", row(2), options).status, 422);
}

}  // namespace
}  // namespace anchord::test::ingest_test
