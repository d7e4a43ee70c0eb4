// Buildings, floors and their plans over a real database; pictures are decoded and traced for real, on the
// calling thread (tests/server/worker_process_test.cpp has the process).
#include "api/places/plan_work.hpp"
#include "app_fixture.hpp"
#include "core/base/sha256.hpp"
#include "core/floor_plan/image.hpp"
#include "core/floor_plan/image_head.hpp"
#include "core/geo/enu.hpp"
#include "core/ports/access_store.hpp"
#include "tests/core/floor_plan/drawings.hpp"
#include "tests/core/floor_plan/pictures.hpp"

namespace anchord::test::places_test {
namespace {

using api::Method;
using api::Role;

/// 16 x 12 m at 2 cm a pixel: a room of 12 x 8 m whose walls are 30 cm thick, from 2 m to the right and 2 m
/// down.
std::string room() {
  floor_plan::Image image{800, 600, 3, std::vector<std::uint8_t>(800 * 600 * 3, 255)};
  for (int y = 100; y < 500; ++y)
    for (int x = 100; x < 700; ++x)
      if (x < 115 || x >= 685 || y < 115 || y >= 485 || (x >= 395 && x < 401 && y < 300))
        for (int c = 0; c < 3; ++c) image.pixels[static_cast<std::size_t>(3 * (y * 800 + x) + c)] = 0;
  return floor_plan::encode_png(image).value();
}

class Places : public AppFixture {
 protected:
  Call as(Role role, std::map<std::string, std::string> headers = {}, std::string type = "application/json") {
    Call options;
    options.roles = {role};
    options.headers = std::move(headers);
    options.type = std::move(type);
    return options;
  }
  std::string site() {
    const auto made = post("/api/v1/sites", R"({"name":"ghent","origin":{"lon":3.7,"lat":51,"h_m":50}})");
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made)["id"];
  }
  std::string building(const std::string& of) {
    const auto made = post("/api/v1/buildings", R"({"name":"B1","height_m":9,"site":")" + of + "\"}");
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made)["id"];
  }
  std::string floor() {
    const auto made = post("/api/v1/floors",
                           R"({"name":"Ground","level":0,"building":")" + building(site_ = site()) + "\"}");
    EXPECT_EQ(made.status, 201) << made.body;
    return "/api/v1/floors/" + json(made)["id"].get<std::string>();
  }
  api::Response put(const std::string& path, const std::string& floor, const std::string& body,
                    const std::string& type = "application/json",
                    std::map<std::string, std::string> query = {}) {
    auto options = as(Role::integrator, {{"if-match", header(get(floor), "ETag")}}, type);
    options.query = std::move(query);
    return call(Method::put, path, body, options);
  }
  /// Corners of the picture at round metres of the site: its upper left corner 100 m east, 200 m north.
  Json clicks(double wrong_m = 0) {
    const EnuFrame frame({51, 3.7, 50});
    Json points = Json::array();
    for (const auto& [x, y] :
         std::vector<std::pair<int, int>>{{100, 100}, {700, 100}, {700, 500}, {100, 500}}) {
      const auto at =
          frame.wgs84_from_enu(Enu{{100 + 0.02 * x + (points.size() == 2 ? wrong_m : 0), 200 - 0.02 * y, 0}});
      points.push_back({{"name", "corner"}, {"pixel", {x, y}}, {"lon", at.lon_deg}, {"lat", at.lat_deg}});
    }
    return {{"points", points}};
  }
  std::string site_;
};

TEST_F(Places, AreMadeChangedListedAndDeletedWithTheirVersions) {
  const auto at = site();
  const auto b = "/api/v1/buildings/" + building(at);
  const auto id = json(get(b))["id"].get<std::string>();
  const auto made = post("/api/v1/floors",
                         R"({"name":"Mezzanine","level":0.5,"base_height_m":2.6,"building":")" + id + "\"}");
  ASSERT_EQ(made.status, 201) << made.body;
  const auto f = header(made, "Location");
  EXPECT_EQ(json(get(f))["level"], 0.5);
  EXPECT_TRUE(json(get(f))["plan"].is_null());
  EXPECT_EQ(json(get("/api/v1/floors", {{"building", id}}))["items"].size(), 1u);
  EXPECT_EQ(json(get("/api/v1/buildings", {{"site", at}}))["items"].size(), 1u);
  EXPECT_EQ(json(get("/api/v1/buildings", {{"site", id}}))["items"].size(), 0u);
  EXPECT_EQ(call(Method::patch, f, R"({"name":"M"})", as(Role::integrator)).status, 428);
  EXPECT_EQ(call(Method::patch, f, R"({"name":"M"})", as(Role::integrator, {{"if-match", "\"x\""}})).status,
            412);
  const auto etag = header(get(f), "ETag");
  const auto changed = call(Method::patch, f, R"({"name":"M","base_height_m":null})",
                            as(Role::integrator, {{"if-match", etag}}));
  EXPECT_EQ(changed.status, 200) << changed.body;
  EXPECT_TRUE(json(changed)["base_height_m"].is_null());
  EXPECT_NE(header(changed, "ETag"), etag);
  EXPECT_EQ(call(Method::patch, f, R"({"building":"x"})",
                 as(Role::integrator, {{"if-match", header(changed, "ETag")}}))
                .status,
            422);
  // What others stand on stays, and says why.
  const auto refused = call(Method::del, b, "", as(Role::integrator, {{"if-match", header(get(b), "ETag")}}));
  EXPECT_EQ(refused.status, 409);
  EXPECT_NE(refused.body.find("1 floor: delete it first"), std::string::npos) << refused.body;
  EXPECT_EQ(call(Method::del, f, "", as(Role::integrator, {{"if-match", header(changed, "ETag")}})).status,
            204);
  EXPECT_EQ(call(Method::del, b, "", as(Role::integrator, {{"if-match", header(get(b), "ETag")}})).status,
            204);
  EXPECT_EQ(get(b).status, 404);
}

TEST_F(Places, AreReadByReadersAndWrittenByIntegratorsAndAdmins) {
  const auto f = floor();
  for (const Role role : {Role::viewer, Role::integrator, Role::engineer, Role::op, Role::admin}) {
    for (const char* part : {"", "/walls"}) EXPECT_EQ(call(Method::get, f + part, "", as(role)).status, 200);
    const bool writes = role == Role::integrator || role == Role::admin;
    for (const auto& [method, path] :
         std::vector<std::pair<Method, std::string>>{{Method::post, "/api/v1/buildings"},
                                                     {Method::post, "/api/v1/floors"},
                                                     {Method::patch, f},
                                                     {Method::put, f + "/plan"},
                                                     {Method::put, f + "/plan/georeference"},
                                                     {Method::post, f + "/plan/trace"},
                                                     {Method::put, f + "/walls"},
                                                     {Method::del, f + "/plan"}}) {
      const auto answer = call(method, path, "{}", as(role, {{"if-match", "\"none\""}}));
      EXPECT_EQ(answer.status == 403, !writes) << to_string(role) << ' ' << path << ' ' << answer.status;
    }
  }
  EXPECT_EQ(call(Method::get, f, "", as(Role::gateway)).status, 403);
}

/// The worker's work with something that happens meanwhile.
class BusyPlaces : public Places {
 protected:
  void configure(api::Application::Deps& deps) override {
    deps.run_plan_work = [this](const std::string& message, const api::WorkProgressSink& progress,
                                const std::function<bool()>& canceled) {
      if (auto meanwhile = std::exchange(meanwhile_, nullptr)) meanwhile();
      if (message.find(R"("task":"tiles")") < message.find('\n')) {
        if (refuse_tiles_) return Result<std::string>(api::too_busy(api::plan_work_cpu_s(message)));
        if (say_of_tiles_) return Result<std::string>(*say_of_tiles_);
      }
      return api::plan_work_inline(message, progress, canceled);
    };
  }
  api::Response put_as(const std::string& token, const std::string& floor) {
    auto options = as(Role::integrator, {{"if-match", header(get(floor), "ETag")}}, "image/png");
    options.token = token;
    return call(Method::put, floor + "/plan", room(), options);
  }
  std::function<void()> meanwhile_;
  bool refuse_tiles_{false};
  std::optional<std::string> say_of_tiles_;
};

TEST_F(BusyPlaces, ReadAPlanOfEachOfTwoTokensAtOnceAndRefuseMoreWithWhatToDo) {
  const auto mine = floor(), others = floor(), third = floor();
  meanwhile_ = [&] {
    const auto again = put_as("one", mine);
    EXPECT_EQ(again.status, 429) << again.body;
    EXPECT_EQ(header(again, "Retry-After"), "1");
    EXPECT_NE(again.body.find("another plan of this token is being processed"), std::string::npos)
        << again.body;
    meanwhile_ = [&] {
      const auto full = put_as("three", third);
      EXPECT_EQ(full.status, 503) << full.body;
      EXPECT_EQ(header(full, "Retry-After"), "1");
    };
    EXPECT_EQ(put_as("two", others).status, 201) << "not kept waiting by another's picture";
  };
  EXPECT_EQ(put_as("one", mine).status, 201);
  EXPECT_EQ(put_as("three", third).status, 201) << "every place is given back";
}

TEST_F(Places, TakeAPlanAndGiveItBackByteForByte) {
  const auto f = floor();
  const auto file = room();
  const auto sent = put(f + "/plan", f, file, "image/png");
  ASSERT_EQ(sent.status, 201) << sent.body;
  EXPECT_EQ(json(sent)["plan"]["width_px"], 800);
  EXPECT_EQ(json(sent)["plan"]["media_type"], "image/png");
  EXPECT_EQ(json(sent)["plan"]["preview"]["height_px"], 600);
  const auto got = get(f + "/plan");
  EXPECT_EQ(header(got, "Content-Type"), "image/png");
  EXPECT_TRUE(got.body == file);
  const auto etag = header(got, "ETag");
  EXPECT_EQ(etag, '"' + json(sent)["plan"]["sha256"].get<std::string>() + '"');
  EXPECT_EQ(call(Method::get, f + "/plan", "", as(Role::viewer, {{"if-none-match", etag}})).status, 304);
  EXPECT_EQ(get(f + "/plan/backdrop").status, 404);
  EXPECT_EQ(put(f + "/plan", f, file, "image/png").status, 200);
  const auto gone =
      call(Method::del, f + "/plan", "", as(Role::integrator, {{"if-match", header(get(f), "ETag")}}));
  EXPECT_EQ(gone.status, 204) << gone.body;
  EXPECT_EQ(get(f + "/plan").status, 404);
}

TEST_F(Places, RefuseFilesThatAreNoPlansWithAReason) {
  const auto f = floor();
  const auto good = room();
  struct Case {
    std::string file;
    int status;
    const char* says;
  };
  for (const auto& [file, status, says] :
       std::vector<Case>{{floor_plan::png_head(50'000, 50'000), 413, "50000 x 50000 pixels"},
                         {floor_plan::png_head(20'000, 20'000), 413, "100 million"},
                         {good.substr(0, good.size() / 2), 422, "cut short"},
                         {floor_plan::png_head(400, 300), 422, "cannot be decoded"},
                         {"GIF89a", 415, "PNG, JPEG, (Geo)TIFF, PDF or ASCII DXF"},
                         {"%PDF-1.7", 415, "cannot read PDF"},
                         {"AutoCAD Binary DXF\r\n\x1a", 415, "save it as ASCII DXF"},
                         {floor_plan::dxf::entities("0\nTEXT\n1\nA\n"), 422, "no line in its model space"},
                         {"0\nSECTION\n2\nENTITIES\n0\nLINE\n1x\n", 422, "near its line"},
                         {"\xff\xd8\xff\xe0 broken", 422, "cut short"},
                         {good + std::string(51u << 20, 'x'), 413, "50 MiB"}}) {
    const auto answer = put(f + "/plan", f, file, "application/octet-stream");
    EXPECT_EQ(answer.status, status) << answer.body;
    EXPECT_NE(answer.body.find(says), std::string::npos) << says << ": " << answer.body;
  }
  EXPECT_TRUE(json(get(f))["plan"].is_null());
}

TEST_F(Places, PlaceAPlanByClickedPointsAndServeItNorthUp) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  EXPECT_EQ(put(f + "/plan/georeference", f, R"({"points":[{"pixel":[1,2],"lon":3}]})").status, 422);
  const auto tried =
      put(f + "/plan/georeference", f, clicks().dump(), "application/json", {{"dry_run", "true"}});
  ASSERT_EQ(tried.status, 200) << tried.body;
  EXPECT_LT(json(tried)["georeference"]["rms_m"].get<double>(), 1e-3);
  EXPECT_TRUE(json(get(f))["georeference"].is_null());
  const auto placed = put(f + "/plan/georeference", f, clicks().dump());
  ASSERT_EQ(placed.status, 200) << placed.body;
  const auto body = json(placed);
  EXPECT_NEAR(body["georeference"]["scale_m_per_px"].get<double>(), 0.02, 1e-6);
  EXPECT_EQ(body["georeference"]["redundancy"], 4);
  EXPECT_TRUE(body["georeference"]["wrong"].is_null());
  EXPECT_EQ(body["georeference"]["origin"]["lat"], 51);
  const auto extent = body["backdrop"]["extent_m"];
  const double expected[4] = {100, 188, 116, 200};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(extent[i].get<double>(), expected[i], 1e-3) << i;
  const auto backdrop = get(f + "/plan/backdrop");
  EXPECT_EQ(backdrop.status, 200);
  const auto image = floor_plan::decode_image(std::as_bytes(std::span(backdrop.body)));
  ASSERT_TRUE(image.has_value());
  EXPECT_EQ(image.value().width_px, body["backdrop"]["width_px"]);
  EXPECT_NEAR(image.value().width_px, 800, 1);
}

TEST_F(Places, ServeAPlacedPlanInTilesOfEveryLevelAndSayWhereTheyAre) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  EXPECT_TRUE(json(get(f))["tiles"].is_null());
  EXPECT_TRUE(json(get(f))["tiles_missing"].is_null()) << "nothing is missing of a plan that is not placed";
  EXPECT_EQ(get(f + "/plan/tiles/0/0/0").status, 404);
  const auto placed = put(f + "/plan/georeference", f, clicks().dump());
  ASSERT_EQ(placed.status, 200) << placed.body;
  const auto tiles = json(get(f))["tiles"];
  EXPECT_EQ(json(placed)["tiles"], tiles);
  EXPECT_EQ(tiles["tile_px"], 256);
  EXPECT_NEAR(tiles["north_west_m"][0].get<double>(), 100, 1e-3);
  EXPECT_NEAR(tiles["north_west_m"][1].get<double>(), 200, 1e-3);
  EXPECT_EQ(tiles["origin"]["lat"], 51);
  // 800 x 600 pixels of 2 cm: 4 x 3 tiles, of twice and four times that 2 x 2 and 1.
  ASSERT_EQ(tiles["levels"].size(), 3u);
  const int across[3][2] = {{1, 1}, {2, 2}, {4, 3}};
  for (std::size_t level = 0; level < 3; ++level) {
    EXPECT_EQ(tiles["levels"][level]["level"], level);
    EXPECT_EQ(tiles["levels"][level]["columns"], across[level][0]);
    EXPECT_EQ(tiles["levels"][level]["rows"], across[level][1]);
    EXPECT_NEAR(tiles["levels"][level]["m_per_px"].get<double>(), 0.08 / (1 << level), 1e-6);
  }
  // The north-west corner of the wall, at (102, 198) m: pixel (100, 100) of the last level.
  const auto tile = get(f + "/plan/tiles/2/0/0");
  ASSERT_EQ(tile.status, 200) << tile.body;
  EXPECT_EQ(header(tile, "Content-Type"), "image/png");
  const auto image = floor_plan::decode_image(std::as_bytes(std::span(tile.body))).value();
  ASSERT_EQ(image.width_px, 256);
  const auto ink = [&](int x, int y) {
    return image.pixels[static_cast<std::size_t>(3 * (y * 256 + x))] < 128;
  };
  EXPECT_TRUE(ink(102, 102));
  EXPECT_FALSE(ink(97, 102));
  EXPECT_FALSE(ink(102, 97));
  const auto etag = header(tile, "ETag");
  EXPECT_EQ(
      call(Method::get, f + "/plan/tiles/2/3/2", "", as(Role::viewer, {{"if-none-match", etag}})).status,
      304);
  const auto outside = get(f + "/plan/tiles/2/4/0");
  EXPECT_EQ(outside.status, 404);
  EXPECT_NE(outside.body.find("level 2 of the plan has columns 0 to 3 and rows 0 to 2"), std::string::npos)
      << outside.body;
  const auto above = get(f + "/plan/tiles/3/0/0");
  EXPECT_EQ(above.status, 404);
  EXPECT_NE(above.body.find("levels 0 to 2"), std::string::npos) << above.body;
  for (const char* none : {"2/-1/0", "2/0/x", "x/0/0", "2/0/99999999999"})
    EXPECT_EQ(get(f + "/plan/tiles/" + none).status, 404) << none;
  // A new plan takes them along.
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 200);
  EXPECT_EQ(get(f + "/plan/tiles/2/0/0").status, 404);
}

TEST_F(Places, AnswerATileThatNothingOfThePlanLiesOnWithoutAPicture) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  // Turned by 45 degrees: 16 x 12 m become a square of 19.8 m on its corner.
  const double c = 0.02 * std::sqrt(0.5);
  Json points = Json::array();
  for (const auto& [x, y] : std::vector<std::pair<int, int>>{{0, 0}, {800, 0}, {0, 600}})
    points.push_back({{"pixel", {x, y}}, {"enu_m", {c * (x + y), c * (x - y)}}});
  const auto placed = put(f + "/plan/georeference", f, Json{{"points", points}}.dump());
  ASSERT_EQ(placed.status, 200) << placed.body;
  EXPECT_EQ(get(f + "/plan/tiles/2/0/0").status, 204);
  EXPECT_EQ(get(f + "/plan/tiles/2/1/1").status, 200);
}

TEST_F(BusyPlaces, KeepTheBackdropOfAPlanWhoseTilesCouldNotBeMadeAndSayWhy) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  refuse_tiles_ = true;
  const auto placed = put(f + "/plan/georeference", f, clicks().dump());
  ASSERT_EQ(placed.status, 200) << placed.body;
  EXPECT_TRUE(json(get(f))["tiles"].is_null());
  EXPECT_NE(json(get(f))["tiles_missing"].get<std::string>().find("more than 60 s of processor time"),
            std::string::npos)
      << get(f).body;
  EXPECT_EQ(get(f + "/plan/backdrop").status, 200);
  const auto none = get(f + "/plan/tiles/0/0/0");
  EXPECT_EQ(none.status, 404);
  EXPECT_NE(none.body.find("tiles_missing"), std::string::npos) << none.body;
  refuse_tiles_ = false;
  ASSERT_EQ(put(f + "/plan/georeference", f, clicks().dump()).status, 200);
  EXPECT_TRUE(json(get(f))["tiles_missing"].is_null());
  EXPECT_EQ(get(f + "/plan/tiles/0/0/0").status, 200);
}

TEST_F(BusyPlaces, TakeNothingOnTrustThatAWorkerSaysOfTiles) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  for (
      const char* answer :
      {"", "no JSON\n", "{}\n",
       R"({"north_west_m":[0,0],"m_per_px":0.1,"width_px":10,"height_px":10,"n_levels":1,"tiles":[[0,0,0,99]]})"
       "\nshort",
       R"({"north_west_m":[0,0],"m_per_px":0.1,"width_px":10,"height_px":10,"n_levels":1,"tiles":[[0,0,0,3]]})"
       "\nGIF",
       R"({"north_west_m":[0,0],"m_per_px":0.1,"width_px":10,"height_px":10,"n_levels":60,"tiles":[]})"
       "\n",
       R"({"north_west_m":[0,0],"m_per_px":-1,"width_px":10,"height_px":10,"n_levels":1,"tiles":[]})"
       "\n"}) {
    say_of_tiles_ = answer;
    ASSERT_EQ(put(f + "/plan/georeference", f, clicks().dump()).status, 200) << answer;
    EXPECT_TRUE(json(get(f))["tiles"].is_null()) << answer;
    EXPECT_EQ(json(get(f))["tiles_missing"], "the answer of the worker process cannot be read") << answer;
  }
}

TEST_F(Places, NameThePointThatDoesNotFitTheOthers) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  const auto tried =
      put(f + "/plan/georeference", f, clicks(2.5).dump(), "application/json", {{"dry_run", "true"}});
  EXPECT_EQ(json(tried)["georeference"]["wrong"], 2);
  const auto refused = put(f + "/plan/georeference", f, clicks(2.5).dump());
  EXPECT_EQ(refused.status, 422);
  EXPECT_NE(refused.body.find("point 3 (corner) lies 2.50 m"), std::string::npos) << refused.body;
  EXPECT_TRUE(json(get(f))["georeference"].is_null());
}

TEST_F(Places, PlaceAGeoTiffByItsTagsAndAPictureByItsWorldFile) {
  const auto made = post("/api/v1/sites", R"({"name":"no origin"})");
  const auto b = building(json(made)["id"]);
  const auto f =
      header(post("/api/v1/floors", R"({"name":"G","level":0,"building":")" + b + "\"}"), "Location");
  const auto sent = put(f + "/plan", f, floor_plan::tiff(false, false), "image/tiff");
  ASSERT_EQ(sent.status, 201) << sent.body;
  const auto geo = json(sent)["georeference"];
  ASSERT_TRUE(geo.is_object()) << sent.body;
  EXPECT_EQ(geo["source"], "geotiff");
  EXPECT_EQ(geo["epsg"], 25831);
  // The central meridian of zone 31; the northing of 5 600 000 m there, by GDAL's gdaltransform.
  EXPECT_NEAR(geo["origin"]["lon"].get<double>(), 3.00001411567, 1e-8);
  EXPECT_NEAR(geo["origin"]["lat"].get<double>(), 50.55192901, 1e-8);
  EXPECT_NEAR(geo["enu_from_pixel"][0].get<double>(), 0.5 / 0.9996, 1e-6);  // UTM's scale
  const auto world = put(f + "/plan/georeference", f,
                         R"({"world_file":[0.5,0,0,-0.25,500000.25,5599999.875],"epsg":25831})");
  ASSERT_EQ(world.status, 200) << world.body;
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_NEAR(json(world)["georeference"]["enu_from_pixel"][i].get<double>(),
                geo["enu_from_pixel"][i].get<double>(), 1e-6);
  EXPECT_EQ(put(f + "/plan/georeference", f, R"({"world_file":[0,0,0,0,1,1],"epsg":25831})").status, 422);
  EXPECT_EQ(put(f + "/plan/georeference", f, R"({"geotiff":true})").status, 200);
}

TEST_F(Places, DrawADxfAndPlaceItWhereItIsInTheMapSystemOfItsSite) {
  const auto made = post("/api/v1/sites", R"({"name":"dock","projected_epsg":25831,"crs":{"frame":"ETRS89"},)"
                                          R"("origin":{"lon":3.00001411567,"lat":50.55192901,"h_m":30}})");
  ASSERT_EQ(made.status, 201) << made.body;
  const auto b = building(json(made)["id"]);
  const auto f =
      header(post("/api/v1/floors", R"({"name":"G","level":0,"building":")" + b + "\"}"), "Location");
  namespace dxf = floor_plan::dxf;
  // Of its own system first: the walls are there, the place is to be clicked.
  const auto own = put(f + "/plan", f, dxf::header(4) + dxf::entities(dxf::room_mm(0)), "image/vnd.dxf");
  ASSERT_EQ(own.status, 201) << own.body;
  EXPECT_EQ(json(own)["plan"]["media_type"], "image/png");
  EXPECT_EQ(json(own)["plan"]["width_px"], 12 * 50 + 40) << "2 cm a pixel and a margin of 20";
  EXPECT_TRUE(json(own)["georeference"].is_null());
  EXPECT_TRUE(get(f + "/plan").body.starts_with("\x89PNG"));
  // The origin is 500 001 m east, 5 599 999.625 m north in zone 31 by gdaltransform: the test of GeoTIFF
  // above.
  const auto mapped =
      put(f + "/plan", f, dxf::header(4) + dxf::entities(dxf::room_mm(0, 500'001'000, 5'600'000'000)),
          "application/octet-stream");
  ASSERT_EQ(mapped.status, 200) << mapped.body;
  const auto geo = json(mapped)["georeference"];
  ASSERT_TRUE(geo.is_object()) << mapped.body;
  EXPECT_EQ(geo["source"], "drawing");
  const auto& m = geo["enu_from_pixel"];
  const auto at = [&](std::size_t row, double x, double y) {
    return m[3 * row].get<double>() * x + m[3 * row + 1].get<double>() * y + m[3 * row + 2].get<double>();
  };
  EXPECT_NEAR(at(0, 20, 420), 0, 0.01) << "the lower left corner, UTM 0.4 mm a metre smaller than the ground";
  EXPECT_NEAR(at(1, 20, 420), 0.375 / 0.9996, 0.01);
  EXPECT_NEAR(at(0, 620, 420), 12 / 0.9996, 0.01);
}

TEST_F(Places, TraceAPlanAndKeepWhatAPersonAccepts) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  EXPECT_EQ(post(f + "/plan/trace", "").status, 422) << "no scale yet";
  ASSERT_EQ(put(f + "/plan/georeference", f, clicks().dump()).status, 200);
  EXPECT_EQ(get(f + "/plan/trace").status, 404);
  const auto traced =
      call(Method::post, f + "/plan/trace", "", as(Role::integrator, {{"prefer", "wait=60"}}));
  ASSERT_EQ(traced.status, 200) << traced.body;
  EXPECT_EQ(json(traced)["walls"].size(), 5u) << traced.body;
  const EnuFrame frame({51, 3.7, 50});
  double west = 1e9, east = -1e9;
  const auto proposal = json(traced);
  for (const auto& corner : proposal["outline"]["coordinates"][0]) {
    const auto m = frame.enu_from_wgs84({corner[1].get<double>(), corner[0].get<double>(), 50}).m;
    west = std::min(west, m.x());
    east = std::max(east, m.x());
  }
  EXPECT_NEAR(west, 102, 0.03);
  EXPECT_NEAR(east, 114, 0.03);
  EXPECT_EQ(json(get(f))["n_walls"], 0) << "nothing is used before it is accepted";
  const auto kept = put(f + "/walls", f, R"({"from_trace":true,"material":"brick"})");
  ASSERT_EQ(kept.status, 200) << kept.body;
  EXPECT_EQ(json(kept)["walls"][0]["material"], "brick");
  EXPECT_EQ(json(get(f))["n_walls"], 5);
  // Mended by hand, and given to the site by who may.
  auto mended = json(kept);
  mended["walls"].erase(0);
  mended["site_outline"] = true;
  EXPECT_EQ(put(f + "/walls", f, mended.dump()).status, 403);
  auto admin = as(Role::admin, {{"if-match", header(get(f), "ETag")}});
  EXPECT_EQ(call(Method::put, f + "/walls", mended.dump(), admin).status, 200);
  EXPECT_EQ(json(get("/api/v1/sites/" + site_))["outline"], mended["outline"]);
  EXPECT_EQ(put(f + "/walls", f, R"({"walls":[{"from":[1,2],"to":[1,95]}]})").status, 422);
  EXPECT_EQ(
      put(f + "/walls", f, R"({"outline":{"type":"Polygon","coordinates":[[[1,2],[2,3],[1,2]]]}})").status,
      422);
  // A new plan leaves what was accepted, and takes what was traced.
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 200);
  EXPECT_EQ(json(get(f))["n_walls"], 4);
  EXPECT_EQ(get(f + "/plan/trace").status, 404);
}

TEST_F(Places, AreAudited) {
  const auto f = floor();
  ASSERT_EQ(put(f + "/plan", f, room(), "image/png").status, 201);
  const auto log = get("/api/v1/audit");
  for (const char* what : {"building.create", "floor.create", "floor.plan "})
    EXPECT_NE(log.body.find(what), std::string::npos) << what;
}

TEST_F(Places, OutliveARestart) {
  const auto f = floor();
  const auto file = room();
  ASSERT_EQ(put(f + "/plan", f, file, "image/png").status, 201);
  restart();
  EXPECT_TRUE(get(f + "/plan").body == file);
}

}  // namespace
}  // namespace anchord::test::places_test
