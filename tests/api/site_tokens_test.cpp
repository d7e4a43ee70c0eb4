// Tokens that are bound to sites: what is of another site is not there, through every route there is.
#include <regex>

#include "api/kit/contract.hpp"
#include "api/scope/route_sites.hpp"
#include "core/ports/access_store.hpp"
#include "core/ports/learning_store.hpp"
#include "site_tokens_fixture.hpp"

namespace anchord::test::site_tokens_test {
namespace {

using api::SiteRule;

/// The path with what its parameters name; `of`: by the kind of thing that is.
std::string with_params(const std::string& pattern, const std::map<std::string, std::string>& of) {
  static const std::vector<std::pair<std::string, std::string>> k_ids{
      {"/api/v1/missions/", "mission"},
      {"/api/v1/plans/", "plan"},
      {"/api/v1/frames/", "frame"},
      {"/api/v1/sites/", "site"},
      {"/api/v1/organizations/", "organization"},
      {"/api/v1/anchors/", "anchor"},
      {"/api/v1/calibrations/", "calibration"},
      {"/api/v1/jobs/", "job"},
      {"/api/v1/buildings/", "building"},
      {"/api/v1/floors/", "floor"},
      {"/api/v1/ranges/", "range"},
      {"/omlox/v2/zones/", "floor"},
      {"/omlox/v2/providers/", "provider"},
      {"/omlox/v2/trackables/", "trackable"}};
  std::string path = pattern;
  const auto put = [&](const std::string& name, const std::string& value) {
    const auto at = path.find('{' + name + '}');
    if (at != std::string::npos) path.replace(at, name.size() + 2, value);
  };
  for (const auto& [prefix, kind] : k_ids)
    if (pattern.starts_with(prefix)) put("id", of.at(kind));
  put("number", of.at("number"));
  put("exclusion", of.at("exclusion"));
  put("anchor", of.at("network_id"));
  put("item", "battery");
  for (const char* digit : {"level", "column", "row"}) put(digit, "0");
  return path;
}

/// Without what differs from one id to the other.
std::string generic(std::string text) {
  static const std::regex uuid("[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}");
  static const std::regex instance(R"("instance":"[^"]*")");
  static const std::regex number(R"((range|revision) [0-9]+)");
  return std::regex_replace(std::regex_replace(std::regex_replace(text, instance, ""), uuid, "ID"), number,
                            "$1 N");
}

class SiteTokenRoutes : public SiteTokens {
 protected:
  /// By what with_params() asks for.
  static std::map<std::string, std::string> named(const Firm& firm) {
    auto out = firm.ids;
    out["network_id"] = firm.network_ids[0];
    return out;
  }
  std::map<std::string, std::string> nobody() {
    auto out = named(bravo_);
    for (auto& [of, id] : out)
      if (of != "exclusion" && of != "network_id") id = to_string(make_uuid_v7(clock_.now()));
    out["provider"] = "gnss-" + out["trackable"];
    out["range"] = "999999";
    out["number"] = "999";
    return out;
  }
  /// A body that the route would take, so that it comes to what it names.
  static std::string body_for(const api::RouteSites& route) {
    if (route.method == Method::get || route.method == Method::del) return {};
    if (route.pattern.ends_with("/actions")) return R"({"action":"finish"})";
    if (route.pattern.ends_with("/control")) return R"({"action":"take"})";
    if (route.pattern.ends_with("/georeference")) return R"({"points":[]})";
    return "{}";
  }
};

TEST_P(SiteTokenRoutes, EveryRouteHasARowAndEveryRowARoute) {
  std::set<std::string> served, ruled;
  for (const auto& route : app_->router().routes())
    served.insert(std::string(to_string(route.method)) + ' ' + route.pattern);
  for (const auto& row : api::route_sites())
    EXPECT_TRUE(ruled.insert(std::string(to_string(row.method)) + ' ' + std::string(row.pattern)).second)
        << "twice: " << row.pattern;
  for (const auto& one : served)
    EXPECT_TRUE(ruled.contains(one)) << one << " has no row in api/scope/route_sites.cpp";
  for (const auto& one : ruled) EXPECT_TRUE(served.contains(one)) << one << " is no route";
  EXPECT_EQ(api::site_rule(Method::get, "/api/v1/of-tomorrow"), SiteRule::refused);
}

TEST_P(SiteTokenRoutes, WhatIsOfAnotherSiteIsAnsweredAsWhatNeverWas) {
  for (const auto& route : api::route_sites()) {
    const std::string pattern(route.pattern), what = std::string(to_string(route.method)) + ' ' + pattern;
    if (pattern.find('{') == std::string::npos || pattern.starts_with("/ogc") || pattern.starts_with("/prob"))
      continue;
    std::string theirs = pattern, unknown = pattern;
    const bool refused =
        route.rule == SiteRule::refused || (route.rule == SiteRule::own && GetParam() == Bound::to_sites);
    if (refused) {
      theirs = unknown = std::regex_replace(pattern, std::regex("\\{[a-z]+\\}"), alpha_.id("site"));
    } else {
      theirs = with_params(pattern, named(alpha_));
      unknown = with_params(pattern, nobody());
    }
    const SiteTokens::Ask ask{body_for(route)};
    const auto answer = as(bravo_.who, route.method, theirs, ask);
    const auto never = as(bravo_.who, route.method, unknown, ask);
    if (refused) {
      EXPECT_EQ(answer.status, 403) << what << ' ' << text(answer);
    } else if (answer.status != 415 && answer.status != 422) {  // it did not come to what it names
      EXPECT_EQ(answer.status, 404) << what << ' ' << text(answer);
    }
    EXPECT_EQ(answer.status, never.status) << what << ' ' << text(never);
    EXPECT_EQ(generic(text(answer)), generic(text(never))) << what;
    const auto own = as(alpha_.who, Method::get, "/api/v1/missions/" + alpha_.id("mission"));
    ASSERT_EQ(own.status, 200) << what << " did it, though it said " << answer.status;
  }
  for (const char* of : {"plan", "building", "floor", "frame", "site", "calibration", "anchor"})
    EXPECT_EQ(get_as(alpha_, std::string("/api/v1/") + of + "s/" + alpha_.id(of)).status, 200) << of;
}

// Else the test above would pass of a server that answers 404 to everything.
TEST_P(SiteTokenRoutes, WhatIsOfItsOwnSiteIsThere) {
  const std::set<std::string> none_yet{"/api/v1/missions/{id}/procedure",
                                       "/api/v1/missions/{id}/grid",
                                       "/api/v1/missions/{id}/plan",
                                       "/api/v1/missions/{id}/plan/change",
                                       "/api/v1/ranges/{id}/cir",
                                       "/api/v1/bundles/uploads/{id}",
                                       "/api/v1/floors/{id}/plan",
                                       "/api/v1/floors/{id}/plan/preview",
                                       "/api/v1/floors/{id}/plan/backdrop",
                                       "/api/v1/floors/{id}/plan/tiles/{level}/{column}/{row}",
                                       "/api/v1/floors/{id}/plan/trace",
                                       "/api/v1/floors/{id}/walls",
                                       "/omlox/v2/zones/{id}"};
  std::size_t seen = 0;
  for (const auto& route : api::route_sites()) {
    const std::string pattern(route.pattern);
    if (route.method != Method::get || route.rule == SiteRule::refused ||
        pattern.find('{') == std::string::npos || pattern.starts_with("/ogc") || pattern.starts_with("/prob"))
      continue;
    const auto answer = as(alpha_.who, Method::get, with_params(pattern, named(alpha_)));
    if (none_yet.contains(pattern)) continue;
    if (pattern.starts_with("/api/v1/organizations") && GetParam() == Bound::to_sites) {
      EXPECT_EQ(answer.status, 404) << pattern << ": of who is bound to it";
      continue;
    }
    EXPECT_NE(answer.status, 404) << pattern << ' ' << text(answer);
    EXPECT_NE(answer.status, 403) << pattern << ' ' << text(answer);
    ++seen;
  }
  EXPECT_GE(seen, 20u);
}

TEST_P(SiteTokenRoutes, ListsExportsAndDocumentsHoldNothingOfAnotherSite) {
  const std::map<std::string, std::string> of_theirs{{"mission", alpha_.id("mission")},
                                                     {"site", alpha_.id("site")},
                                                     {"organization", alpha_.id("organization")},
                                                     {"building", alpha_.id("building")},
                                                     {"revision", alpha_.id("number")},
                                                     {"view", "live"},
                                                     {"deleted", "true"},
                                                     {"cursor", alpha_.id("mission")}};
  for (const auto& route : api::route_sites()) {
    const std::string pattern(route.pattern);
    const bool ogc = pattern.starts_with("/ogc");
    if (route.method != Method::get || route.rule == SiteRule::open ||
        (pattern.find('{') != std::string::npos && !ogc))
      continue;
    std::vector<std::string> paths{pattern};
    if (pattern.find("{collection}") != std::string::npos) {
      paths.clear();
      for (const char* collection : {"anchors", "revisions", "tracks", "zones"}) {
        auto path = std::regex_replace(pattern, std::regex("\\{collection\\}"), collection);
        for (const char* of : {"mission", "floor"})
          paths.push_back(std::regex_replace(path, std::regex("\\{feature\\}"), alpha_.id(of)));
        paths.push_back(std::regex_replace(path, std::regex("\\{feature\\}"), alpha_.network_ids[0]));
        paths.push_back(std::regex_replace(path, std::regex("\\{feature\\}"),
                                           alpha_.id("number") + '-' + alpha_.network_ids[0]));
      }
    }
    for (const auto& path : paths) {
      const auto held = [&](const std::map<std::string, std::string>& query) {
        std::string body = text(get_as(bravo_, path, query));
        // An answer may say again what it was asked.
        const auto take_out = [&](const std::string& asked) {
          for (auto at = body.find(asked); at != std::string::npos; at = body.find(asked))
            body.erase(at, asked.size());
        };
        take_out(path);
        if (path.find("/items/") != std::string::npos) take_out(path.substr(path.rfind('/') + 1));
        for (const auto& [key, value] : query)
          if (value.size() > 8) take_out(value);
        EXPECT_EQ(betrayed(alpha_, body), "") << path << (query.empty() ? "" : " " + query.begin()->first);
      };
      held({});
      for (const auto& [key, value] : of_theirs) held({{key, value}});
      for (const char* format :
           {"geojson", "json", "csv", "ndjson", "kml", "gpkg", "dxf", "ifc", "pnezd", "pozyx"})
        held({{"format", format}});
      if (path.find("/items/") != std::string::npos) {
        EXPECT_EQ(get_as(bravo_, path).status, 404) << path;
      }
    }
  }
  EXPECT_NE(betrayed(alpha_, text(get_as(alpha_, "/api/v1/exports/anchors.csv"))), "");
  EXPECT_NE(betrayed(alpha_, text(get_as(alpha_, "/ogc/collections/tracks/items"))), "");
  EXPECT_EQ(json(get_as(bravo_, "/ogc/collections/anchors/items"))["numberMatched"], 2);
}

TEST_P(SiteTokenRoutes, PagesAreFullAndEndWithTheLastOfItsOwn) {
  for (int i = 0; i < 3; ++i) {
    for (const auto* firm : {&alpha_, &bravo_})
      ASSERT_EQ(post_as(*firm, "/api/v1/missions",
                        {{"name", firm->word},
                         {"site", firm->id("site")},
                         {"frame", "wgs84"},
                         {"track_point", "tag_antenna"}})
                    .status,
                201);
  }
  const auto first = json(get_as(bravo_, "/api/v1/missions", {{"limit", "3"}}));
  EXPECT_EQ(first["items"].size(), 3u);
  const auto rest =
      json(get_as(bravo_, "/api/v1/missions", {{"limit", "3"}, {"cursor", first["next_cursor"]}}));
  EXPECT_EQ(rest["items"].size(), 1u);
  EXPECT_TRUE(rest["next_cursor"].is_null());
}

TEST_P(SiteTokenRoutes, WhatHasNoSiteIsForTokensOfEverySite) {
  const auto siteless = mission();
  EXPECT_EQ(get("/api/v1/missions/" + siteless).status, 200);
  EXPECT_EQ(get_as(alpha_, "/api/v1/missions/" + siteless).status, 404);
  EXPECT_EQ(json(get("/api/v1/missions"))["items"].size(), 3u);
  EXPECT_EQ(json(get_as(alpha_, "/api/v1/missions"))["items"].size(), 1u);
}

TEST_P(SiteTokenRoutes, SystemSaysOfTheWholeServerWhatItsLiveTopicSays) {
  const Json all = json(get("/api/v1/system")), bound = json(get_as(alpha_, "/api/v1/system"));
  for (const char* of_the_server : {"clock", "drone", "mqtt", "cir_archive"}) {
    EXPECT_TRUE(all.contains(of_the_server));
    EXPECT_FALSE(bound.contains(of_the_server)) << bound;
  }
  for (const char* shared : {"writable", "reason", "disk_free_bytes", "queue_depth", "recording"})
    EXPECT_TRUE(bound.contains(shared)) << bound;
}

TEST_P(SiteTokenRoutes, NothingIsWrittenOfOrIntoAnotherSite) {
  const auto refused = [&](const std::string& path, const Json& body) {
    const auto answer = post_as(bravo_, path, body);
    EXPECT_GE(answer.status, 404) << path << ' ' << answer.body;
    EXPECT_LT(answer.status, 500) << path << ' ' << answer.body;
  };
  const std::string site = alpha_.id("site");
  Json plan = json(get_as(bravo_, "/api/v1/plans/" + bravo_.id("plan")));
  for (const char* key : {"id", "revision", "created_at", "changed_at"}) plan.erase(key);
  plan["site"] = site;
  refused("/api/v1/plans", plan);
  refused("/api/v1/missions", {{"name", "x"}, {"site", site}});
  refused("/api/v1/frames", {{"name", "x"}, {"site", site}});
  const auto to_alpha = Json{{"site", site}}.dump();
  EXPECT_EQ(as_match(bravo_, Method::patch, "/api/v1/plans/" + bravo_.id("plan"), to_alpha).status, 422);
  for (const auto& where : {to_alpha, std::string(R"({"site":null})")})
    EXPECT_EQ(as_match(bravo_, Method::patch, "/api/v1/anchors/" + bravo_.network_ids[0], where).status, 422);
  const auto to_alphas = Json{{"organization", alpha_.id("organization")}}.dump();
  for (const auto& where : {to_alphas, Json{{"organization", bravo_.id("organization")}}.dump()}) {
    const bool stays = where != to_alphas && GetParam() == Bound::to_organization;
    EXPECT_EQ(as_match(bravo_, Method::patch, "/api/v1/sites/" + bravo_.id("site"), where).status,
              stays ? 200 : 403);
  }
  EXPECT_EQ(
      post_as(bravo_, "/api/v1/sites", {{"name", "x"}, {"organization", alpha_.id("organization")}}).status,
      GetParam() == Bound::to_organization ? 422 : 403);
  refused("/api/v1/buildings", {{"name", "x"}, {"site", site}});
  refused("/api/v1/floors", {{"name", "x"}, {"level", 1}, {"building", alpha_.id("building")}});
  refused("/api/v1/calibrations", {{"missions", {alpha_.id("mission")}}});
  refused("/api/v1/calibrations",
          {{"missions", {bravo_.id("mission")}}, {"learn_from", {alpha_.id("mission")}}});
  refused("/api/v1/calibrations", {{"missions", {bravo_.id("mission")}}, {"frame", "alpha-frame"}});
  refused("/api/v1/transform",
          {{"from", "local"}, {"to", "geo"}, {"frame", "alpha-frame"}, {"points", Json::array()}});
  for (const char* path : {"/api/v1/ranges", "/api/v1/fixes"}) {
    const auto sent = as(bravo_.who, Method::post, path,
                         {R"({"t_us":1777889472000000,"tag":"0x6e01","anchor":"0x1","distance_m":7})",
                          {{"mission", alpha_.id("mission")}}});
    EXPECT_EQ(sent.status, 404) << sent.body;
  }
  const auto row = as(bravo_.who, Method::post, "/api/v1/ranges",
                      {Json{{"t_us", 1777889472000000},
                            {"mission", alpha_.id("mission")},
                            {"tag", "0x6e01"},
                            {"anchor", "0x1"},
                            {"distance_m", 7}}
                           .dump()});
  EXPECT_EQ(json(row).value("accepted", 0), 0) << row.body;
  EXPECT_EQ(get_as(bravo_, "/api/v1/calibrations/" + bravo_.id("calibration") + "/diff",
                   {{"against", alpha_.id("calibration")}})
                .status,
            404);
}

// Models are of the whole server, which a bound token does not see: a calibration must not tell which there
// are.
TEST_P(SiteTokenRoutes, AModelThatIsThereIsAnsweredAsOneThatNeverWas) {
  StoredModel model;
  model.id.uuid = make_uuid_v7(clock_.now());
  model.task = "los_bias";
  model.method = "constant";
  model.manifest = {"{}"};
  model.created = clock_.now();
  ASSERT_TRUE(database_->stores().models.insert(model, "{}").has_value());
  const auto asked = [&](const ModelId& id) {
    return post_as(bravo_, "/api/v1/calibrations",
                   {{"missions", {bravo_.id("mission")}}, {"models", {{"los_bias", to_string(id)}}}});
  };
  const auto there = asked(model.id), never = asked(ModelId{make_uuid_v7(clock_.now())});
  EXPECT_EQ(there.status, never.status) << there.body;
  EXPECT_EQ(generic(there.body), generic(never.body));
  EXPECT_EQ(never.status, 422) << never.body;
}

TEST_P(SiteTokenRoutes, WhatIsMadeWithoutASiteIsOfTheOneThatTheTokenIsBoundTo) {
  Json plan = json(get_as(bravo_, "/api/v1/plans/" + bravo_.id("plan")));
  for (const char* key : {"id", "revision", "created_at", "changed_at", "site"}) plan.erase(key);
  Firm both = bravo_;
  both.who.sites = SiteSet::only(
      {SiteId{parse_uuid(alpha_.id("site")).value()}, SiteId{parse_uuid(bravo_.id("site")).value()}});
  for (const auto& [path, body] : std::map<std::string, Json>{
           {"/api/v1/missions", {{"name", "x"}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}}},
           {"/api/v1/frames", {{"name", "x"}}},
           {"/api/v1/plans", plan}}) {
    EXPECT_EQ(post_as(both, path, body).status, 422) << path << ": of which of the two?";
    const auto made = post_as(bravo_, path, body);
    ASSERT_EQ(made.status, 201) << path << ' ' << made.body;
    EXPECT_EQ(json(made)["site"], bravo_.id("site")) << path;
  }
}

TEST_P(SiteTokenRoutes, AnAnchorOfAnotherSiteIsNotPublishedUnderItsNetworkId) {
  int n = 0;
  const auto calibration = stored_calibration([&](Estimate& e) { e.anchor = {n++ == 0 ? 0xa1a1u : 0xb2b9u}; },
                                              bravo_.id("mission"));
  const auto path = "/api/v1/calibrations/" + calibration + "/publish";
  const auto all = as(bravo_.who, Method::post, path, {"{}"});
  EXPECT_EQ(all.status, 409) << all.body;
  EXPECT_EQ(betrayed(alpha_, std::regex_replace(all.body, std::regex("0xa1a1"), "")), "");
  const auto own = as(bravo_.who, Method::post, path, {R"({"anchors":["0xb2b9"]})"});
  EXPECT_EQ(own.status, 201) << own.body;
  EXPECT_EQ(json(get_as(bravo_, "/api/v1/anchors"))["features"].size(), 3u);
  EXPECT_EQ(json(get_as(alpha_, "/api/v1/anchors"))["features"].size(), 2u);
  EXPECT_EQ(json(get_as(alpha_, "/api/v1/revisions"))["items"].size(), 1u);
}

TEST_P(SiteTokenRoutes, TheAuditLogNamesTheTokenThatChangedSomething) {
  const auto entries = database_->stores().access.audit(1000).value();
  const auto by = [&](const std::string& who, const std::string& what) {
    return std::ranges::any_of(entries, [&](const auto& e) { return e.who == who && e.what == what; });
  };
  EXPECT_TRUE(by(alpha_.who.token_id, "mission.create " + alpha_.id("mission")));
  EXPECT_TRUE(by(alpha_.who.token_id, "anchor.change 0xa1a1 site: " + alpha_.id("site")));
  EXPECT_FALSE(by(bravo_.who.token_id, "mission.create " + alpha_.id("mission")));
}

TEST_P(SiteTokenRoutes, SaysOfWhichSitesATokenIs) {
  EXPECT_EQ(json(get_as(alpha_, "/api/v1/me"))["sites"], Json::array({alpha_.id("site")}));
  EXPECT_EQ(json(get_as(alpha_, "/api/v1/me"))["organization"],
            GetParam() == Bound::to_organization ? Json(alpha_.id("organization")) : Json());
  EXPECT_TRUE(json(get("/api/v1/me"))["sites"].is_null());
  EXPECT_TRUE(json(get("/api/v1/me"))["organization"].is_null());
  const auto tokens = json(get("/api/v1/tokens"))["items"];
  EXPECT_EQ(std::ranges::count_if(tokens, [](const Json& t) { return t["sites"].is_array(); }), 2);
  for (const Json& sites :
       {Json::array(), Json("x"), Json::array({"x"}), Json::array({alpha_.id("mission")})})
    EXPECT_EQ(
        post("/api/v1/tokens", Json{{"name", "t"}, {"roles", {"viewer"}}, {"sites", sites}}.dump()).status,
        422)
        << sites;
  restart();
  const auto kept = json(get("/api/v1/tokens"))["items"];
  ASSERT_EQ(kept.size(), tokens.size());
  for (std::size_t i = 0; i < kept.size(); ++i) EXPECT_EQ(kept[i]["sites"], tokens[i]["sites"]);
}

TEST_P(SiteTokenRoutes, ATokenWhoseSiteIsGoneSeesNothing) {
  const auto empty = post("/api/v1/sites", R"({"name":"short-lived"})");
  const std::string site = json(empty)["id"];
  const auto token =
      post("/api/v1/tokens", Json{{"name", "t"}, {"roles", {"admin"}}, {"sites", {site}}}.dump());
  Call removal;
  removal.headers["if-match"] = header(empty, "ETag");
  ASSERT_EQ(call(Method::del, "/api/v1/sites/" + site, "", removal).status, 204);
  restart();
  const auto who = access_->verify(json(token)["token"].get<std::string>()).value();
  EXPECT_FALSE(who.sites.all());
  EXPECT_TRUE(json(as(who, Method::get, "/api/v1/sites"))["items"].empty());
  EXPECT_TRUE(json(as(who, Method::get, "/api/v1/missions"))["items"].empty());
}

INSTANTIATE_TEST_SUITE_P(Bound, SiteTokenRoutes, ::testing::Values(Bound::to_sites, Bound::to_organization),
                         bound_name);

}  // namespace
}  // namespace anchord::test::site_tokens_test
