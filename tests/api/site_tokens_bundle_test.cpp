// Bundles for tokens that are bound to sites, out and in; and what a site may store, over REST.
#include <fstream>

#include "api/formats/zip_archive.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/kit_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"
#include "site_tokens_fixture.hpp"
#include "tests/api/zip_builder.hpp"

namespace anchord::test::site_tokens_bundle_test {
namespace {

/// A server where nothing is yet.
class EmptyServer : public SiteTokens {
 public:
  EmptyServer() { AppFixture::SetUp(); }
  ~EmptyServer() override { AppFixture::TearDown(); }
  void SetUp() override {}
  void TearDown() override {}
  void TestBody() override {}
  using SiteTokens::as;
  Stores stores() { return database_->stores(); }

 protected:
  void configure(api::Application::Deps& deps) override { deps.spool_dir = dir_ / "spool"; }
};

class SiteTokenBundles : public SiteTokens {
 protected:
  void configure(api::Application::Deps& deps) override { deps.spool_dir = dir_ / "spool"; }
  void SetUp() override {
    SiteTokens::SetUp();
    // Alfa's flight heard an anchor of bravo too, and its kit learned something.
    Firm heard = alpha_;
    heard.network_ids = bravo_.network_ids;
    fly(heard, alpha_.id("mission"), 30);
    ASSERT_TRUE(database_->stores().missions.finish(mission_of(alpha_), clock_.now()));
    Mission flown = database_->stores().missions.mission(mission_of(alpha_)).value();
    flown.kit = "kit-7";
    ASSERT_TRUE(database_->stores().missions.update(flown));
    StoredProfile profile;
    profile.kit = flown.kit;
    profile.time = clock_.now();
    profile.by = profile.source = "bravo's word";
    profile.profile = {"{}"};
    ASSERT_TRUE(database_->stores().kits.put(profile, 0));
    restart();
  }
  static MissionId mission_of(const Firm& firm) { return MissionId{parse_uuid(firm.id("mission")).value()}; }
  static SiteId site_of(const Firm& firm) { return SiteId{parse_uuid(firm.id("site")).value()}; }
  /// For another server, which has no organizations.
  Site stored_site(const Firm& firm) {
    Site site = database_->stores().sites.site(site_of(firm)).value();
    site.organization.reset();
    return site;
  }
  std::string downloaded(const Firm& firm, const std::string& path) {
    const auto answer = get_as(firm, path);
    EXPECT_EQ(answer.status, 200) << path << ' ' << answer.body;
    return text(answer);
  }
  std::map<std::string, std::string> entries_of(const std::string& bytes) {
    const auto file = dir_ / "looked at.zip";
    std::ofstream(file, std::ios::binary) << bytes;
    const auto zip = api::ZipReader::open(file);
    EXPECT_TRUE(zip) << zip.error().message;
    std::map<std::string, std::string> out;
    for (const auto& entry : zip.value().entries())
      out[entry.name] = zip.value().text(entry.name, std::uint64_t{1} << 30).value();
    return out;
  }
  static std::string joined(const std::map<std::string, std::string>& entries) {
    std::string out;
    for (const auto& [name, content] : entries) out += name + '\n' + content;
    return out;
  }
  static std::size_t lines(const std::string& text) {
    return static_cast<std::size_t>(std::ranges::count(text, '\n'));
  }
  template <class Server>
  api::Response take(Server& server, const api::Principal& who, const std::string& bytes) {
    return server.as(who, Method::post, "/api/v1/bundles", {bytes, {}, "application/zip"});
  }
  /// Without the radios: that they were heard is of the flight that heard them.
  static Firm named(Firm firm) {
    firm.network_ids.clear();
    return firm;
  }
  std::string bundle_of(const Firm& firm) {
    return downloaded(firm, "/api/v1/missions/" + firm.id("mission") + "/bundle");
  }
  std::string site_bundle_of(const Firm& firm) {
    return downloaded(firm, "/api/v1/sites/" + firm.id("site") + "/bundle");
  }
};

TEST_P(SiteTokenBundles, OfAFlightHaveNothingOfAnotherSiteOrOfTheWholeServer) {
  auto entries = entries_of(bundle_of(alpha_));
  EXPECT_EQ(betrayed(named(bravo_), joined(entries)), "");
  EXPECT_NE(betrayed(alpha_, joined(entries)), "");
  EXPECT_EQ(lines(entries["tables/uwb_range.ndjson"]), 21u) << "every range of the flight, whomever it heard";
  EXPECT_EQ(lines(entries["tables/anchor.ndjson"]), 2u) << "one, and the names of columns";
  EXPECT_GE(lines(entries["tables/calibration.ndjson"]), 2u);
  for (const char* table : {"kit_profile", "model", "revision", "revision_position"})
    EXPECT_EQ(lines(entries["tables/" + std::string(table) + ".ndjson"]), 1u) << table;
  EXPECT_FALSE(entries.contains("notes/audit.ndjson"));
  // Who sees all has all of it.
  Call options;
  const auto whole = call(Method::get, "/api/v1/missions/" + alpha_.id("mission") + "/bundle", "", options);
  auto all = entries_of(text(whole));
  EXPECT_EQ(lines(all["tables/anchor.ndjson"]), 3u);
  EXPECT_EQ(lines(all["tables/kit_profile.ndjson"]), 2u);
  EXPECT_EQ(lines(all["tables/revision.ndjson"]), 2u);
}

TEST_P(SiteTokenBundles, OfASiteHaveItsBuildingsAndNothingOfAnother) {
  auto entries = entries_of(site_bundle_of(alpha_));
  EXPECT_NE(entries["tables/building_floor.ndjson"].find("alfa ground"), std::string::npos);
  std::string all = joined(entries);
  all += joined(entries_of(entries["missions/" + alpha_.id("mission") + ".anchord"]));
  EXPECT_EQ(betrayed(named(bravo_), all), "");
  EXPECT_EQ(get_as(bravo_, "/api/v1/sites/" + alpha_.id("site") + "/bundle").status, 404);
}

TEST_P(SiteTokenBundles, HandOverPacksAreOfTheirOwnFlights) {
  const auto pack = downloaded(alpha_, "/api/v1/missions/" + alpha_.id("mission") + "/handover");
  const auto entries = entries_of(pack);
  EXPECT_TRUE(entries.contains("bundle.anchord"));
  EXPECT_EQ(betrayed(named(bravo_), joined(entries) + joined(entries_of(entries.at("bundle.anchord")))), "");
  EXPECT_EQ(get_as(bravo_, "/api/v1/missions/" + alpha_.id("mission") + "/handover").status, 404);
}

TEST_P(SiteTokenBundles, AreTakenIntoTheirSiteAndIntoNoOther) {
  const auto bytes = site_bundle_of(alpha_);
  for (const auto& sent : {bytes, bundle_of(alpha_)}) {
    const auto refused = take(*this, bravo_.who, sent);
    EXPECT_EQ(refused.status, 409) << refused.body;
    EXPECT_NE(refused.body.find("another site"), std::string::npos) << refused.body;
    EXPECT_EQ(take(*this, alpha_.who, sent).status, 200) << "all of it is here";
  }
  EmptyServer other;
  ASSERT_TRUE(other.stores().sites.insert(stored_site(alpha_)));
  const auto taken = take(other, alpha_.who, bytes);
  ASSERT_EQ(taken.status, 201) << taken.body;
  EXPECT_EQ(json(taken)["flights"][0]["mission"], alpha_.id("mission"));
  EXPECT_EQ(get_as(alpha_, "/api/v1/missions/" + alpha_.id("mission")).status, 200);
  const auto there = [&](const std::string& path) { return other.as(alpha_.who, Method::get, path).status; };
  for (const char* of : {"mission", "building", "floor", "plan", "frame", "calibration", "anchor"})
    EXPECT_EQ(there(std::string("/api/v1/") + of + "s/" + alpha_.id(of)), 200) << of;
}

TEST_P(SiteTokenBundles, BringNothingOfTheWholeServer) {
  Call options;
  const auto whole = call(Method::get, "/api/v1/missions/" + alpha_.id("mission") + "/bundle", "", options);
  const auto bytes = text(whole);
  EmptyServer other;
  ASSERT_TRUE(other.stores().sites.insert(stored_site(alpha_)));
  const auto taken = take(other, alpha_.who, bytes);
  ASSERT_EQ(taken.status, 201) << taken.body;
  EXPECT_TRUE(other.stores().missions.mission(mission_of(alpha_)));
  EXPECT_TRUE(other.stores().revisions.revisions(10, 0).value().empty());
  EXPECT_FALSE(other.stores().kits.profile("kit-7").value());
  EXPECT_EQ(other.stores().anchors.anchors(10, {}).value().size(), 1u) << "not that of bravo";
  EXPECT_FALSE(other.stores().sites.site(site_of(bravo_)));
  const std::string left_out = json(taken)["left_out"].dump();
  for (const char* table : {"rows of revision", "rows of kit_profile", "rows of anchor"})
    EXPECT_NE(left_out.find(table), std::string::npos) << left_out;
}

// The bundle says that the building is theirs; here it is of somebody else.
TEST_P(SiteTokenBundles, PutNoFloorIntoABuildingOfAnotherSite) {
  const auto bytes = site_bundle_of(alpha_);
  EmptyServer other;
  for (const auto* firm : {&alpha_, &bravo_}) ASSERT_TRUE(other.stores().sites.insert(stored_site(*firm)));
  Building building =
      database_->stores().places.building(BuildingId{parse_uuid(alpha_.id("building")).value()}).value();
  building.site = site_of(bravo_);
  ASSERT_TRUE(other.stores().places.insert(building));
  const auto taken = take(other, alpha_.who, bytes);
  ASSERT_EQ(taken.status, 201) << taken.body;
  EXPECT_TRUE(other.stores().places.floors(10, {}, building.id).value().empty());
  EXPECT_EQ(other.stores().places.building(building.id).value().site, site_of(bravo_));
}

TEST_P(SiteTokenBundles, OmloxHasTheProvidersOfTheirOwnFlights) {
  for (const auto* firm : {&alpha_, &bravo_}) {
    const auto* other = firm == &alpha_ ? &bravo_ : &alpha_;
    fly(*firm, firm->id("mission"), 50);
    for (const char* path :
         {"/omlox/v2/providers/summary", "/omlox/v2/trackables/summary", "/omlox/v2/providers/locations"}) {
      const auto answer = text(get_as(*firm, path));
      EXPECT_EQ(betrayed(*other, answer), "") << path;
    }
    const auto own = json(get_as(*firm, "/omlox/v2/providers/summary"));
    ASSERT_EQ(own.size(), 1u) << own;
    const std::string id = own[0]["id"];
    EXPECT_EQ(get_as(*firm, "/omlox/v2/providers/" + id).status, 200);
    EXPECT_EQ(get_as(*other, "/omlox/v2/providers/" + id).status, 404);
    EXPECT_EQ(get_as(*other, "/omlox/v2/providers/" + id + "/location").status, 404);
    const std::string trackable = json(get_as(*firm, "/omlox/v2/trackables"))[0];
    EXPECT_EQ(get_as(*firm, "/omlox/v2/trackables/" + trackable).status, 200);
    EXPECT_EQ(get_as(*other, "/omlox/v2/trackables/" + trackable + "/locations").status, 404);
  }
  EXPECT_EQ(json(get("/omlox/v2/providers")).size(), 2u);
}

TEST_P(SiteTokenBundles, QuotasAreSetByWhoSeesAllAndHoldTheNextFlightBack) {
  const std::string path = "/api/v1/sites/" + bravo_.id("site") + "/quota";
  const auto set = [&](const Json& limits) { return call(Method::put, path, limits.dump(), Call{}); };
  const auto limited = set({{"missions", 5}, {"measurements", 20}, {"anchors", nullptr}});
  ASSERT_EQ(limited.status, 200) << limited.body;
  EXPECT_EQ(json(limited), Json::parse(R"({"limits":{"missions":5,"measurements":20,"anchors":null},)"
                                       R"("used":{"missions":1,"measurements":20,"anchors":2},)"
                                       R"("reached":["measurements"]})"));
  EXPECT_EQ(json(get_as(bravo_, path)), json(limited));
  EXPECT_EQ(as(bravo_.who, Method::put, path, {R"({"missions":null})"}).status, 403);
  EXPECT_EQ(get_as(alpha_, path).status, 404);
  EXPECT_EQ(set({{"missions", 5}}).status, 422) << "a limit that is forgotten would be none";
  EXPECT_EQ(set({{"missions", -1}, {"measurements", nullptr}, {"anchors", nullptr}}).status, 422);

  const Json next{
      {"name", "next"}, {"site", bravo_.id("site")}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}};
  const auto refused = post_as(bravo_, "/api/v1/missions", next);
  EXPECT_EQ(refused.status, 409) << refused.body;
  const std::string detail = json(refused)["detail"];
  for (const std::string& part : {std::string("bravo works"), std::string("20 measurements"), path})
    EXPECT_NE(detail.find(part), std::string::npos) << detail;
  fly(bravo_, bravo_.id("mission"), 40);  // expects every row to be accepted
  EXPECT_EQ(json(get_as(bravo_, path))["used"]["measurements"], 40);
  ASSERT_EQ(set({{"missions", nullptr}, {"measurements", nullptr}, {"anchors", nullptr}}).status, 200);
  EXPECT_EQ(post_as(bravo_, "/api/v1/missions", next).status, 201);
}

INSTANTIATE_TEST_SUITE_P(Bound, SiteTokenBundles, ::testing::Values(Bound::to_sites, Bound::to_organization),
                         bound_name);

}  // namespace
}  // namespace anchord::test::site_tokens_bundle_test
