// Organizations: who makes them, what their tokens see when sites come and go, their quotas.
#include "api/stream/hub.hpp"
#include "api/stream/ws_handler.hpp"
#include "site_tokens_fixture.hpp"

namespace anchord::test::organizations_test {
namespace {

class Organizations : public SiteTokens {
 protected:
  static std::string path(const Firm& firm) { return "/api/v1/organizations/" + firm.id("organization"); }
  api::Response change(const std::string& path, const Json& patch, api::Method method = api::Method::patch) {
    Call options;
    options.headers["if-match"] = header(get(path), "ETag");
    return call(method, path, method == api::Method::del ? "" : patch.dump(), options);
  }
  void move(const std::string& site, const Json& to) {
    const auto moved = change("/api/v1/sites/" + site, {{"organization", to}});
    ASSERT_EQ(moved.status, 200) << moved.body;
    EXPECT_EQ(json(moved)["organization"], to);
  }
  Json limits(const Json& change) {
    Json all{{"missions", nullptr},
             {"measurements", nullptr},
             {"anchors", nullptr},
             {"sites", nullptr},
             {"requests_per_minute", nullptr}};
    if (change.is_object()) all.update(change);
    return all;
  }
  void set_quota(const Firm& firm, const Json& change) {
    const auto set = call(Method::put, path(firm) + "/quota", limits(change).dump(), Call{});
    ASSERT_EQ(set.status, 200) << set.body;
  }
  std::vector<std::string> names(const api::Response& page) {
    std::vector<std::string> out;
    const Json body = json(page);
    for (const auto& item : body["items"]) out.push_back(item["name"]);
    return out;
  }
  /// Everything that has been sent until a frame with `last` is there.
  static std::string frames_until(api::WsHandler& client, const std::string& last) {
    std::string all;
    for (int i = 0; i < 200 && all.find(last) == std::string::npos; ++i) {
      while (const auto frame = client.next_frame()) all += *frame + '\n';
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_NE(all.find(last), std::string::npos) << "never came: " << last;
    return all;
  }
};

TEST_P(Organizations, AreMadeReadChangedAndRemoved) {
  const auto made = post("/api/v1/organizations", R"({"name":"Third","description":"a customer"})");
  ASSERT_EQ(made.status, 201) << made.body;
  const auto at = header(made, "Location");
  EXPECT_EQ(at, "/api/v1/organizations/" + json(made)["id"].get<std::string>());
  EXPECT_EQ(json(get(at)), json(made));
  EXPECT_EQ(header(get(at), "ETag"), header(made, "ETag"));
  EXPECT_EQ(call(Method::patch, at, R"({"name":"x"})", Call{}).status, 428);
  const auto changed = change(at, {{"description", nullptr}});
  EXPECT_EQ(changed.status, 200);
  EXPECT_TRUE(json(changed)["description"].is_null());
  EXPECT_EQ(json(changed)["name"], "Third");
  Call stale;
  stale.headers["if-match"] = header(made, "ETag");
  EXPECT_EQ(call(Method::patch, at, R"({"name":"x"})", stale).status, 412);
  for (const char* wrong : {R"({"name":""})", R"({})", R"({"name":"x","owner":"y"})", R"({"name":7})"})
    EXPECT_EQ(post("/api/v1/organizations", wrong).status, 422) << wrong;
  EXPECT_EQ(names(get("/api/v1/organizations")),
            (std::vector<std::string>{"alfa group", "bravo group", "Third"}));
  EXPECT_EQ(names(get("/api/v1/organizations", {{"limit", "1"}})), std::vector<std::string>{"alfa group"});
  EXPECT_EQ(change(at, {}, Method::del).status, 204);
  EXPECT_EQ(get(at).status, 404);
  const auto refused = change(path(alpha_), {}, Method::del);
  EXPECT_EQ(refused.status, 409);
  EXPECT_NE(refused.body.find("1 sites and 1 tokens"), std::string::npos) << refused.body;
}

TEST_P(Organizations, AreSeenByTheirOwnTokensAndWrittenByNone) {
  EXPECT_EQ(names(get_as(alpha_, "/api/v1/organizations")), std::vector<std::string>{"alfa group"});
  EXPECT_EQ(get_as(alpha_, path(alpha_)).status, 200);
  EXPECT_EQ(json(get_as(alpha_, path(alpha_) + "/quota"))["used"]["sites"], 1);
  for (const auto& of : {path(bravo_), path(bravo_) + "/quota"})
    EXPECT_EQ(get_as(alpha_, of).status, 404) << of;
  EXPECT_EQ(post_as(alpha_, "/api/v1/organizations", {{"name", "x"}}).status, 403);
  EXPECT_EQ(as_match(alpha_, Method::patch, path(alpha_), R"({"name":"x"})").status, 403);
  EXPECT_EQ(as_match(alpha_, Method::del, path(alpha_), "").status, 403);
  EXPECT_EQ(as(alpha_.who, Method::put, path(alpha_) + "/quota", {limits({}).dump()}).status, 403);
  Call engineer;
  engineer.roles = {api::Role::engineer, api::Role::op};
  EXPECT_EQ(call(Method::post, "/api/v1/organizations", R"({"name":"x"})", engineer).status, 403);
  EXPECT_EQ(
      call(Method::patch, "/api/v1/sites/" + alpha_.id("site"), R"({"organization":null})", engineer).status,
      403);
}

TEST_P(Organizations, HaveTheSitesThatTheirTokensMakeAndMayRemoveThem) {
  const auto made = post_as(alpha_, "/api/v1/sites", {{"name", "alfa annex"}});
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(json(made)["organization"], alpha_.id("organization"));
  const auto at = header(made, "Location");
  EXPECT_EQ(get_as(alpha_, at).status, 200);
  EXPECT_EQ(get_as(bravo_, at).status, 404);
  EXPECT_EQ(names(get_as(alpha_, "/api/v1/sites")), (std::vector<std::string>{"alfa works", "alfa annex"}));
  EXPECT_EQ(names(get("/api/v1/sites", {{"organization", alpha_.id("organization")}})),
            (std::vector<std::string>{"alfa works", "alfa annex"}));
  EXPECT_EQ(names(get_as(alpha_, "/api/v1/sites", {{"organization", bravo_.id("organization")}})),
            std::vector<std::string>{});
  EXPECT_EQ(get("/api/v1/sites", {{"organization", "x"}}).status, 422);
  EXPECT_EQ(as_match(alpha_, Method::patch, at, R"({"name":"alfa yard"})").status, 200);
  EXPECT_EQ(as_match(alpha_, Method::patch, at, R"({"organization":null})").status, 403);
  EXPECT_EQ(as_match(alpha_, Method::del, at, "").status, 204);
  EXPECT_EQ(json(get_as(alpha_, "/api/v1/me"))["sites"], Json::array({alpha_.id("site")}));
  EXPECT_EQ(post("/api/v1/sites", Json{{"name", "x"}, {"organization", alpha_.id("mission")}}.dump()).status,
            422);
}

TEST_P(Organizations, SeeASiteThatAnAdministratorGivesThem) {
  const auto made =
      post("/api/v1/sites", Json{{"name", "delta"}, {"organization", alpha_.id("organization")}}.dump());
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(get_as(alpha_, header(made, "Location")).status, 200);
  const std::string free = json(post("/api/v1/sites", R"({"name":"free"})"))["id"];
  EXPECT_EQ(get_as(alpha_, "/api/v1/sites/" + free).status, 404);
  move(free, alpha_.id("organization"));
  EXPECT_EQ(get_as(alpha_, "/api/v1/sites/" + free).status, 200);
  restart();
  const auto token =
      post("/api/v1/tokens",
           Json{{"name", "t"}, {"roles", {"viewer"}}, {"organization", alpha_.id("organization")}}.dump());
  alpha_.who = access_->verify(json(token)["token"].get<std::string>()).value();
  EXPECT_EQ(names(get_as(alpha_, "/api/v1/sites")),
            (std::vector<std::string>{"alfa works", "delta", "free"}));
}

TEST_P(Organizations, LoseASiteAtOnceWithAllThatIsOfIt) {
  const std::string site = "/api/v1/sites/" + alpha_.id("site");
  std::vector<std::string> of_site{site, "/api/v1/jobs/" + alpha_.id("job")};
  for (const char* of : {"mission", "plan", "building", "floor", "frame", "calibration", "anchor"})
    of_site.push_back(std::string("/api/v1/") + of + "s/" + alpha_.id(of));
  for (const auto& one : of_site) EXPECT_EQ(get_as(alpha_, one).status, 200) << one;
  move(alpha_.id("site"), bravo_.id("organization"));
  for (const auto& one : of_site) {
    EXPECT_EQ(get_as(alpha_, one).status, 404) << one;
    if (one.find("/jobs/") == std::string::npos) {
      EXPECT_EQ(get_as(bravo_, one).status, 200) << one;
    }
  }
  EXPECT_TRUE(json(get_as(alpha_, "/api/v1/missions"))["items"].empty());
  EXPECT_EQ(json(get_as(bravo_, "/api/v1/missions"))["items"].size(), 2u);
  const auto sent = as(alpha_.who, Method::post, "/api/v1/ranges",
                       {R"({"t_us":1777889472000000,"tag":"0x6e01","anchor":"0x1","distance_m":7})",
                        {{"mission", alpha_.id("mission")}}});
  EXPECT_EQ(sent.status, 404) << sent.body;
  move(alpha_.id("site"), nullptr);
  for (const auto* firm : {&alpha_, &bravo_}) EXPECT_EQ(get_as(*firm, site).status, 404);
  EXPECT_EQ(get(site).status, 200);
}

// An answer that was kept for Idempotency-Key is given out once more only while what it names is theirs.
TEST_P(Organizations, AreNotAnsweredFromWhatWasKeptOfASiteThatTheyLost) {
  const auto again = [&](const std::string& path, const Json& body) {
    api::Request request;
    request.method = Method::post;
    request.path = path;
    request.body = body.dump();
    request.headers = {{"content-type", "application/json"}, {"idempotency-key", "once " + path}};
    request.principal = alpha_.who;
    request.remote = "127.0.0.1";
    return app_->router().handle(request);
  };
  const Json mission{{"name", "alfa second"},
                     {"site", alpha_.id("site")},
                     {"frame", "wgs84"},
                     {"track_point", "tag_antenna"}};
  const std::string exclusions = "/api/v1/missions/" + alpha_.id("mission") + "/exclusions";
  const Json excluded{{"kind", "ranges"},
                      {"anchor", alpha_.network_ids[0]},
                      {"since", 1'777'889'473'900'000},
                      {"reason", "x"}};
  for (int i = 0; i < 2; ++i) {
    const auto made = again("/api/v1/missions", mission);
    EXPECT_EQ(made.status, 201) << made.body;
    EXPECT_EQ(header(made, "Idempotent-Replayed"), i == 0 ? "" : "true");
    EXPECT_EQ(again(exclusions, excluded).status, 201);
  }
  move(alpha_.id("site"), bravo_.id("organization"));
  for (const auto& gone : {again("/api/v1/missions", mission), again(exclusions, excluded)}) {
    EXPECT_EQ(gone.status, 404) << gone.body;
    EXPECT_EQ(gone.body.find("alfa"), std::string::npos) << gone.body;
  }
}

TEST_P(Organizations, LoseASiteOnStreamsThatAreOpen) {
  const auto listen = [&](const Firm& firm) {
    auto client = app_->ws_factory()(firm.who, [] { return true; });
    client->on_open([] {});
    int id = 0;
    for (const auto& topic : api::topics())
      client->on_text(Json{{"op", "sub"}, {"id", ++id}, {"topic", topic.name}}.dump());
    return client;
  };
  auto alpha = listen(alpha_), bravo = listen(bravo_);
  const MissionId of_alpha{parse_uuid(alpha_.id("mission")).value()},
      of_bravo{parse_uuid(bravo_.id("mission")).value()};
  const auto say = [&](const std::string& word, const MissionId& of) {
    for (const auto& topic : api::topics())
      app_->hub().publish(topic.topic, R"({"name":")" + word + "\"}", 1, word, {}, of);
  };
  say("before", of_alpha);
  frames_until(*alpha, "before");
  move(alpha_.id("site"), bravo_.id("organization"));
  // A site of alpha's own, so that it has something to wait for.
  const auto other = post_as(alpha_, "/api/v1/sites", {{"name", "other"}});
  ASSERT_EQ(other.status, 201);
  const auto second = post_as(
      alpha_, "/api/v1/missions",
      {{"name", "second"}, {"site", json(other)["id"]}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}});
  ASSERT_EQ(second.status, 201) << second.body;
  say("behind", of_alpha);
  say("the last", MissionId{parse_uuid(json(second)["id"].get<std::string>()).value()});
  say("the last", of_bravo);
  const auto to_alpha = frames_until(*alpha, "the last"), to_bravo = frames_until(*bravo, "the last");
  EXPECT_EQ(to_alpha.find("behind"), std::string::npos) << to_alpha;
  EXPECT_NE(to_bravo.find("behind"), std::string::npos) << to_bravo;
  for (auto* client : {&alpha, &bravo}) (*client)->on_close();
}

TEST_P(Organizations, HaveAQuotaBesideThatOfTheSite) {
  set_quota(alpha_, {{"missions", 2}, {"sites", 1}, {"requests_per_minute", 600}});
  const auto quota = json(get_as(alpha_, path(alpha_) + "/quota"));
  EXPECT_EQ(quota["limits"], limits({{"missions", 2}, {"sites", 1}, {"requests_per_minute", 600}}));
  EXPECT_EQ(quota["used"], (Json{{"missions", 1}, {"measurements", 20}, {"anchors", 2}, {"sites", 1}}));
  EXPECT_EQ(quota["reached"], Json::array({"sites"}));
  const auto refused = post_as(alpha_, "/api/v1/sites", {{"name", "one too many"}});
  EXPECT_EQ(refused.status, 409);
  EXPECT_NE(refused.body.find("PUT /api/v1/organizations/" + alpha_.id("organization") + "/quota"),
            std::string::npos)
      << refused.body;
  const Json mission{
      {"name", "next"}, {"site", alpha_.id("site")}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}};
  EXPECT_EQ(post_as(alpha_, "/api/v1/missions", mission).status, 201);
  EXPECT_EQ(post_as(alpha_, "/api/v1/missions", mission).status, 409);
  fly(alpha_, alpha_.id("mission"), 7);
  for (const Json& wrong : {Json{{"missions", 1}}, limits({{"requests_per_minute", 0}}),
                            limits({{"sites", -1}}), limits({{"users", 3}})})
    EXPECT_EQ(call(Method::put, path(alpha_) + "/quota", wrong.dump(), Call{}).status, 422) << wrong;
  EXPECT_EQ(
      call(Method::put, "/api/v1/organizations/" + alpha_.id("site") + "/quota", limits({}).dump(), Call{})
          .status,
      404);
}

TEST_P(Organizations, BindATokenThatNamesNoSitesAndRefuseWhatContradicts) {
  const auto token = [&](const Json& more) {
    Json body{{"name", "t"}, {"roles", {"admin"}}};
    body.update(more);
    return post("/api/v1/tokens", body.dump());
  };
  const auto organization = alpha_.id("organization");
  const auto both = token({{"organization", organization}, {"sites", {alpha_.id("site")}}});
  EXPECT_EQ(both.status, 422);
  EXPECT_NE(both.body.find("leave one of the two out"), std::string::npos) << both.body;
  EXPECT_EQ(token({{"organization", alpha_.id("site")}}).status, 422);
  EXPECT_EQ(token({{"organization", 7}}).status, 422);
  EXPECT_EQ(token({{"requests_per_minute", 60}}).status, 422) << "an admin of every site";
  EXPECT_EQ(token({{"requests_per_minute", 0}, {"organization", organization}}).status, 422);
  const auto made = token({{"requests_per_minute", 60}, {"organization", organization}});
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(json(made)["organization"], organization);
  EXPECT_EQ(json(made)["requests_per_minute"], 60);
  EXPECT_EQ(json(made)["sites"], Json::array({alpha_.id("site")}));
  restart();
  const auto who = access_->verify(json(made)["token"].get<std::string>()).value();
  const auto me = json(as(who, Method::get, "/api/v1/me"));
  EXPECT_EQ(me["organization"], organization);
  EXPECT_EQ(me["requests_per_minute"], 60);
}

INSTANTIATE_TEST_SUITE_P(Bound, Organizations, ::testing::Values(Bound::to_organization), bound_name);

}  // namespace
}  // namespace anchord::test::organizations_test
