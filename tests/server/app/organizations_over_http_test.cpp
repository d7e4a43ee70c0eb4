// Two customers of one centre, as they meet it: over HTTP, each with a token of its own.
#include <nlohmann/json.hpp>

#include "tests/server/app/app_fixture.hpp"

namespace anchord::test::organizations_over_http_test {
namespace {

using Json = nlohmann::json;

class Centre : public testing::Test {
 protected:
  Centre() : server_(Settings{{"rate.burst", "100000"}}) {}
  void SetUp() override { ASSERT_TRUE(server_.app) << server_.error.message; }

  struct Customer {
    std::string organization, token;
  };
  server::ClientResponse ask(const std::string& token, std::string_view method, const std::string& path,
                             const Json& body = nullptr, const std::string& etag = {}) {
    auto headers = server_.bearer(token);
    if (!etag.empty()) headers["If-Match"] = etag;
    return server_.call(method, path, body.is_null() ? "" : body.dump(), headers);
  }
  Json made(const std::string& token, const std::string& path, const Json& body) {
    const auto answer = ask(token, "POST", path, body);
    EXPECT_EQ(answer.status, 201) << path << ' ' << answer.body;
    return answer.status == 201 ? Json::parse(answer.body) : Json::object();
  }
  Customer customer(const std::string& name) {
    Customer out;
    out.organization = made(server_.admin, "/api/v1/organizations", {{"name", name}})["id"];
    out.token = token_of(out.organization, {});
    return out;
  }
  std::string token_of(const std::string& organization, const Json& more) {
    Json body{{"name", "t"}, {"roles", {"admin"}}, {"organization", organization}};
    if (more.is_object()) body.update(more);
    return made(server_.admin, "/api/v1/tokens", body)["token"];
  }
  std::vector<std::string> sites_of(const std::string& token) {
    std::vector<std::string> out;
    const Json page = Json::parse(ask(token, "GET", "/api/v1/sites").body);
    for (const auto& site : page["items"]) out.push_back(site["name"]);
    return out;
  }
  void set_quota(const std::string& organization, const Json& change) {
    Json all{{"missions", nullptr},
             {"measurements", nullptr},
             {"anchors", nullptr},
             {"sites", nullptr},
             {"requests_per_minute", nullptr}};
    if (change.is_object()) all.update(change);
    const auto set = ask(server_.admin, "PUT", "/api/v1/organizations/" + organization + "/quota", all);
    ASSERT_EQ(set.status, 200) << set.body;
  }
  /// Asked until it is refused, at most so often; how many were answered.
  int asked_until_refused(const std::string& token, int most, server::ClientResponse& refusal) {
    for (int n = 0; n < most; ++n) {
      refusal = ask(token, "GET", "/api/v1/me");
      if (refusal.status == 429) return n;
    }
    return most;
  }

  AppFixture server_;
};

TEST_F(Centre, KeepsTheSitesOfItsCustomersApart) {
  const auto a = customer("A"), b = customer("B");
  const std::string hall = made(a.token, "/api/v1/sites", {{"name", "hall"}})["id"];
  made(b.token, "/api/v1/sites", {{"name", "yard"}});
  made(server_.admin, "/api/v1/sites", {{"name", "of nobody"}});
  EXPECT_EQ(sites_of(a.token), std::vector<std::string>{"hall"});
  EXPECT_EQ(sites_of(b.token), std::vector<std::string>{"yard"});
  EXPECT_EQ(sites_of(server_.admin).size(), 3u);
  const auto me = Json::parse(ask(a.token, "GET", "/api/v1/me").body);
  EXPECT_EQ(me["organization"], a.organization);
  const auto site = ask(server_.admin, "GET", "/api/v1/sites/" + hall);
  EXPECT_EQ(Json::parse(site.body)["organization"], a.organization);

  const Json to_b{{"organization", b.organization}};
  EXPECT_EQ(ask(a.token, "PATCH", "/api/v1/sites/" + hall, to_b, site.headers.at("etag")).status, 403);
  EXPECT_EQ(ask(server_.admin, "PATCH", "/api/v1/sites/" + hall, to_b, site.headers.at("etag")).status, 200);
  EXPECT_EQ(ask(a.token, "GET", "/api/v1/sites/" + hall).status, 404);
  EXPECT_EQ(sites_of(a.token), std::vector<std::string>{});
  EXPECT_EQ(sites_of(b.token), (std::vector<std::string>{"hall", "yard"}));

  set_quota(b.organization, {{"sites", 2}});
  const auto refused = ask(b.token, "POST", "/api/v1/sites", {{"name", "one too many"}});
  EXPECT_EQ(refused.status, 409);
  EXPECT_NE(refused.body.find("the quota of organization"), std::string::npos) << refused.body;
  EXPECT_EQ(ask(server_.admin, "DELETE", "/api/v1/organizations/" + b.organization, nullptr, "*").status,
            409);
}

TEST_F(Centre, LetsNoCustomerUseUpTheRequestsOfAnother) {
  const auto a = customer("A"), b = customer("B");
  const std::string second = token_of(a.organization, {});
  set_quota(a.organization, {{"requests_per_minute", 20}});
  server::ClientResponse refusal;
  const int answered = asked_until_refused(a.token, 100, refusal);
  EXPECT_GE(answered, 20);
  EXPECT_LT(answered, 100);
  ASSERT_EQ(refusal.status, 429);
  EXPECT_NE(refusal.body.find("rate-limited"), std::string::npos) << refusal.body;
  EXPECT_NE(refusal.body.find(a.organization), std::string::npos) << refusal.body;
  const int wait_s = std::stoi(refusal.headers.at("retry-after"));
  EXPECT_GE(wait_s, 1);
  EXPECT_LE(wait_s, 3) << "one in three seconds";
  EXPECT_EQ(refusal.headers.at("ratelimit-policy"), "\"organization\";q=20;w=60");
  EXPECT_EQ(refusal.headers.at("ratelimit"), "\"organization\";r=0;t=" + std::to_string(wait_s));
  EXPECT_LT(asked_until_refused(second, 50, refusal), 50) << "all tokens of the organization together";
  EXPECT_EQ(asked_until_refused(b.token, 100, refusal), 100);
  EXPECT_EQ(asked_until_refused(server_.admin, 100, refusal), 100);
  set_quota(a.organization, {});
  EXPECT_EQ(asked_until_refused(a.token, 50, refusal), 50) << "no limit any more";
}

TEST_F(Centre, LimitsAScriptOfACustomerByItsTokenAlone) {
  const auto a = customer("A");
  const std::string script = token_of(a.organization, {{"requests_per_minute", 5}});
  server::ClientResponse refusal;
  EXPECT_LT(asked_until_refused(script, 50, refusal), 50);
  EXPECT_EQ(refusal.headers.at("ratelimit-policy"), "\"token\";q=5;w=60");
  EXPECT_EQ(asked_until_refused(a.token, 50, refusal), 50);
}

// What is refused here would be lost, or would leave an aircraft without its pilot.
TEST_F(Centre, TakesEveryMeasurementAndCommandWhateverTheQuota) {
  const auto a = customer("A");
  const std::string site = made(a.token, "/api/v1/sites", {{"name", "hall"}})["id"];
  const std::string mission =
      made(a.token, "/api/v1/missions",
           {{"name", "flight"}, {"site", site}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}})["id"];
  set_quota(a.organization, {{"requests_per_minute", 1}});
  server::ClientResponse refusal;
  ASSERT_LT(asked_until_refused(a.token, 20, refusal), 20);
  for (int i = 0; i < 50; ++i) {
    const Json row{{"t_us", 1'777'889'473'000'000 + i * 100'000},
                   {"tag", "0x6e01"},
                   {"anchor", "0x6a21"},
                   {"distance_m", 7.5}};
    auto client = server::HttpClient::to(server_.url).value();
    client.set_header("Authorization", "Bearer " + a.token);
    const auto answer =
        client.call("POST", "/api/v1/ranges?mission=" + mission, row.dump() + '\n', "application/x-ndjson");
    ASSERT_TRUE(answer) << answer.error().message;
    const auto& sent = answer.value();
    ASSERT_EQ(sent.status, 200) << sent.body;
    ASSERT_EQ(Json::parse(sent.body)["accepted"], 1);
  }
  for (int i = 0; i < 10; ++i) EXPECT_EQ(ask(a.token, "GET", "/api/v1/alarms").status, 200);
  EXPECT_EQ(ask(a.token, "POST", "/api/v1/missions/" + mission + "/actions", {{"action", "finish"}}).status,
            200);
}

}  // namespace
}  // namespace anchord::test::organizations_over_http_test
