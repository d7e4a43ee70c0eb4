#include <sys/stat.h>

#include <algorithm>
#include <thread>

#include "api/kit/router.hpp"
#include "tests/server/app/app_fixture.hpp"
#include "tests/server/http/ws_client.hpp"

namespace anchord::test::access_over_http_test {
namespace {

std::string concrete(std::string pattern) {
  for (auto open = pattern.find('{'); open != std::string::npos; open = pattern.find('{')) {
    pattern.replace(open, pattern.find('}') - open + 1, "0x6a2f");
  }
  return pattern;
}

TEST(AccessTable, DeniesEveryRouteThatIsNotDeclaredOpenToNobody) {
  AppFixture server(Settings{{"rate.burst", "100000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  ASSERT_GT(server.app->router().routes().size(), 30u);
  const std::vector<std::string> open{"/healthz",
                                      "/readyz",
                                      "/version",
                                      "/problems/{type}",
                                      "/api/docs",
                                      "/api/v1/session",
                                      "/api/v1/openapi.json",
                                      "/api/v1/asyncapi.json"};
  for (const auto& route : server.app->router().routes()) {
    const bool listed = std::ranges::find(open, route.pattern) != open.end();
    EXPECT_EQ(route.access.is_open(), listed)
        << route.pattern << " changed its access: change this list knowingly";
    if (listed || route.pattern == "/metrics") continue;  // MetricsAccess below
    const auto method = api::to_string(route.method);
    const auto answer = server.call(method, concrete(route.pattern));
    EXPECT_EQ(answer.status, 401) << method << " " << route.pattern;
    EXPECT_TRUE(answer.headers.contains("www-authenticate")) << route.pattern;
  }
}

TEST(MetricsAccess, NeedsNoTokenFromTheSameMachineUnlessByWayOfAProxy) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  EXPECT_EQ(server.call("GET", "/metrics").status, 200);
  for (const char* header : {"X-Forwarded-For", "Forwarded", "Via"})
    EXPECT_EQ(server.call("GET", "/metrics", {}, {{header, "203.0.113.9"}}).status, 401) << header;
  EXPECT_EQ(server.call("GET", "/api/v1/system").status, 401) << "only the counters";
  EXPECT_EQ(server.call("GET", "/metrics", {}, server.bearer("anc_wrong")).status, 401);
}

TEST(Refusals, AreInTheAuditLogAndCounted) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto viewer = server.bearer(server.token(R"(["viewer"])"));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(server.call("GET", "/api/v1/audit", {}, viewer).status, 403);
  EXPECT_EQ(server.call("GET", "/api/v1/me", {}, server.bearer("anc_guess")).status, 401);
  // Written about once a second, behind the answers.
  std::string audit;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  do {
    audit = server.call("GET", "/api/v1/audit", {}, server.bearer(server.admin)).body;
    std::this_thread::yield();
  } while (audit.find("a token that is unknown") == std::string::npos &&
           std::chrono::steady_clock::now() < deadline);
  EXPECT_NE(audit.find("GET /api/v1/audit"), std::string::npos) << audit;
  EXPECT_NE(audit.find("a token that is unknown"), std::string::npos) << audit;
  EXPECT_EQ(audit.find("anc_guess"), std::string::npos) << "no secrets in the log";
}

TEST(Tokens, TellWhenTheyWereLastUsed) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  server.token(R"(["viewer"])");
  const auto list = server.call("GET", "/api/v1/tokens", {}, server.bearer(server.admin)).body;
  const auto first = list.find("\"last_used_at\":\"20"), second = list.find("\"last_used_at\":null");
  EXPECT_NE(first, std::string::npos) << list;
  EXPECT_NE(second, std::string::npos) << "the new one was never used: " << list;
  EXPECT_EQ(server.call("GET", "/api/v1/tokens?limit=3", {}, server.bearer(server.admin)).status, 422);
}

TEST(Addresses, ThatAreMistypedGetAProblemAndNoPage) {
  AppFixture server(Settings{{"rate.burst", "1000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  for (const char* path : {"/api/v1/missions/x/", "//api/v1/missions", "/api//v1/missions", "/api/v1/nothing",
                           "/api/v2/missions", "/api", "/ogc/nothing", "/metrics/", "/healthz/x", "/live//x",
                           "/API/v1/missions", "/Healthz"}) {
    const auto answer = server.call("GET", path, {}, server.bearer(server.admin));
    EXPECT_EQ(answer.status, 404) << path;
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json") << path;
  }
}

// docs/operations.md says so.
TEST(Caching, LetsABrowserAskAgainAndKeepsSecretsAndErrorsNowhere) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto admin = server.bearer(server.admin);
  const auto control = [&](const char* method, const char* path, const char* body = "") {
    return server.call(method, path, body, admin).headers["cache-control"];
  };
  EXPECT_EQ(control("GET", "/api/v1/missions"), "private, no-cache");
  EXPECT_EQ(control("HEAD", "/api/v1/missions"), "private, no-cache");
  EXPECT_EQ(control("GET", "/api/v1/nothing"), "no-store");
  EXPECT_EQ(control("GET", "/api/v1/missions?limit=x"), "no-store");
  EXPECT_EQ(control("POST", "/api/v1/missions", "{}"), "no-store");
  EXPECT_EQ(control("POST", "/api/v1/ws-tickets", "{}"), "no-store");
  EXPECT_EQ(control("GET", "/api/v1/tokens"), "no-store");
  EXPECT_EQ(control("GET", "/api/v1/me"), "no-store");
}

TEST(DocsPage, ShowsEveryOperationWithoutScriptsOrForeignAddresses) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto page = server.call("GET", "/api/docs");
  ASSERT_EQ(page.status, 200);
  EXPECT_EQ(page.headers.at("content-type"), "text/html; charset=utf-8");
  for (const auto& route : server.app->router().routes()) {
    if (!route.pattern.starts_with("/api/v1/")) continue;
    const std::string head =
        "<code>" + std::string(api::to_string(route.method)) + " " + route.pattern + "</code>";
    EXPECT_NE(page.body.find(head), std::string::npos) << head;
  }
  EXPECT_EQ(page.body.find("<script"), std::string::npos);
  EXPECT_EQ(page.body.find("src="), std::string::npos);
  EXPECT_EQ(page.body.find("href=\"http"), std::string::npos);
}

TEST(AccessTable, LetsAGatewayIngestAndNothingElse) {
  AppFixture server(Settings{{"rate.burst", "100000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto gateway = server.bearer(server.token(R"(["gateway"])"));
  for (const auto& route : server.app->router().routes()) {
    if (route.access.is_open() || route.pattern == "/api/v1/me" || route.pattern == "/api/v1/ws-tickets")
      continue;
    const int status = server.call(api::to_string(route.method), concrete(route.pattern), {}, gateway).status;
    // Ground truth of a campaign is measured in the field as well.
    const bool campaign = route.pattern.starts_with("/api/v1/campaigns") &&
                          (route.method == api::Method::post || route.method == api::Method::patch);
    const bool ingest = campaign || (route.method == api::Method::post &&
                                     (route.pattern == "/api/v1/ranges" || route.pattern == "/api/v1/fixes"));
    EXPECT_EQ(status == 403, !ingest)
        << api::to_string(route.method) << " " << route.pattern << " " << status;
  }
}

TEST(Tokens, AreRefusedOnceRevokedAndInAddresses) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto made = server.call("POST", "/api/v1/tokens", R"({"name":"x","roles":["viewer"]})",
                                server.bearer(server.admin));
  ASSERT_EQ(made.status, 201);
  const std::string token = made.body.substr(made.body.find("anc_"), 101);
  EXPECT_EQ(server.call("GET", "/api/v1/me", {}, server.bearer(token)).status, 200);
  EXPECT_EQ(server.call("GET", "/api/v1/me?token=" + token).status, 400);
  EXPECT_EQ(server.call("GET", "/api/v1/me?x=" + token).status, 400);
  EXPECT_EQ(server.call("GET", "/api/v1/me", {}, server.bearer(token.substr(0, 100) + "x")).status, 401);
  ASSERT_EQ(server.call("DELETE", made.headers.at("location"), {}, server.bearer(server.admin)).status, 204);
  EXPECT_EQ(server.call("GET", "/api/v1/me", {}, server.bearer(token)).status, 401);
  // Every change of tokens is in the audit log.
  const auto audit = server.call("GET", "/api/v1/audit", {}, server.bearer(server.admin)).body;
  EXPECT_NE(audit.find("token create"), std::string::npos);
  EXPECT_NE(audit.find("token revoke"), std::string::npos);
}

TEST(Tokens, AreNeverKeptForIdempotency) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  auto headers = server.bearer(server.admin);
  headers["Idempotency-Key"] = "again";
  const std::string body = R"({"name":"x","roles":["viewer"]})";
  const auto one = server.call("POST", "/api/v1/tokens", body, headers);
  const auto two = server.call("POST", "/api/v1/tokens", body, headers);
  EXPECT_EQ(two.status, 201);
  EXPECT_NE(one.body, two.body) << "a repeated answer would mean that the secret was stored";
}

TEST(Tokens, FirstAdminTokenIsInAFileOnlyItsOwnerMayRead) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  struct stat info {};
  ASSERT_EQ(::stat((server.folder / "data" / server::k_admin_token_file).c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0600u);
  EXPECT_EQ(server.call("GET", "/api/v1/tokens", {}, server.bearer(server.admin)).status, 200);
  // Basic carries the token as password, for programs that know only that: base64 of "x:" + token is made
  // here.
  EXPECT_EQ(server.call("GET", "/api/v1/me", {}, {{"Authorization", "Basic eDp3cm9uZw=="}}).status, 401);
}

TEST(BrowserSession, NeedsTheHeaderAndTheOwnOriginForChanges) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto login = server.call("POST", "/api/v1/session", R"({"token":")" + server.admin + R"("})");
  ASSERT_EQ(login.status, 200);
  const std::string set = login.headers.at("set-cookie");
  EXPECT_NE(set.find("HttpOnly"), std::string::npos);
  EXPECT_NE(set.find("SameSite=Strict"), std::string::npos);
  const std::string cookie = set.substr(0, set.find(';'));
  EXPECT_EQ(server.call("GET", "/api/v1/me", {}, {{"Cookie", cookie}}).status, 200);
  const std::string token = R"({"name":"x","roles":["viewer"]})";
  EXPECT_EQ(server.call("POST", "/api/v1/tokens", token, {{"Cookie", cookie}}).status, 403);
  EXPECT_EQ(server.call("POST", "/api/v1/tokens", token, {{"Cookie", cookie}, {"X-Anchord", "1"}}).status,
            201);
  EXPECT_EQ(server
                .call("POST", "/api/v1/tokens", token,
                      {{"Cookie", cookie}, {"X-Anchord", "1"}, {"Origin", "http://evil.example"}})
                .status,
            403);
  EXPECT_EQ(server
                .call("POST", "/api/v1/tokens", token,
                      {{"Cookie", cookie}, {"X-Anchord", "1"}, {"Origin", server.url}})
                .status,
            201);
  EXPECT_EQ(server.call("DELETE", "/api/v1/session", {}, {{"Cookie", cookie}, {"X-Anchord", "1"}}).status,
            204);
  EXPECT_EQ(server.call("GET", "/api/v1/me", {}, {{"Cookie", cookie}}).status, 401);
}

TEST(BrowserSession, IsNotOpenedByAGuessAndGuessesAreFew) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  server::ClientResponse last;
  for (int i = 0; i < 6; ++i) last = server.call("POST", "/api/v1/session", R"({"token":"anc_guess"})");
  EXPECT_EQ(last.status, 429);
  EXPECT_GE(std::stoi(last.headers["retry-after"]), 1);
}

TEST(LiveAccess, TakesATicketOnceAndNoOtherOrigin) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto made = server.call("POST", "/api/v1/ws-tickets", "{}", server.bearer(server.admin));
  ASSERT_EQ(made.status, 201);
  const std::string ticket = made.body.substr(made.body.find(R"("ticket":")") + 10, 64);
  const std::string host = "Host: localhost\r\n";
  {
    WsClient none(server.port, "/api/v1/ws");
    EXPECT_EQ(status_of(none.handshake), 401);
    WsClient foreign(server.port, "/api/v1/ws?ticket=" + ticket, "Origin: http://evil.example\r\n");
    EXPECT_EQ(status_of(foreign.handshake), 403);
    WsClient wrong(server.port, "/api/v1/ws?ticket=" + ticket, "Sec-WebSocket-Protocol: other.v9\r\n");
    EXPECT_EQ(status_of(wrong.handshake), 400) << "and the ticket is spent";
    WsClient again(server.port, "/api/v1/ws?ticket=" + ticket);
    EXPECT_EQ(status_of(again.handshake), 401);
  }
  const auto second = server.call("POST", "/api/v1/ws-tickets", "{}", server.bearer(server.admin));
  const std::string fresh = second.body.substr(second.body.find(R"("ticket":")") + 10, 64);
  WsClient client(server.port, "/api/v1/ws?ticket=" + fresh, "Sec-WebSocket-Protocol: anchord.v1\r\n");
  ASSERT_TRUE(client.open());
  const auto hello = client.frame();
  ASSERT_TRUE(hello);
  EXPECT_NE(hello->payload.find(R"("op":"hello")"), std::string::npos);
  client.send(2, "binary");
  EXPECT_EQ(client.ended_with(), 1003);
}

TEST(OmloxAccess, TakesATokenInAMessageAndCountsThoseThatHaveNone) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const std::string path = "/omlox/v2/ws/socket";
  const auto subscribe = [](const std::string& token) {
    return R"({"event":"subscribe","topic":"location_updates","params":{"token":")" + token + R"("}})";
  };
  WsClient client(server.port, path);
  ASSERT_TRUE(client.open()) << "its token comes in a message";
  client.send(1, subscribe(server.admin));
  const auto answer = client.frame();
  ASSERT_TRUE(answer);
  EXPECT_NE(answer->payload.find(R"("event":"subscribed")"), std::string::npos) << answer->payload;
  WsClient gateway(server.port, path);
  gateway.send(1, subscribe(server.token(R"(["gateway"])")));
  const auto refused = gateway.frame();
  ASSERT_TRUE(refused);
  EXPECT_NE(refused->payload.find("10004"), std::string::npos) << refused->payload;
  std::vector<std::unique_ptr<WsClient>> strangers;
  for (int i = 0; i < 3; ++i) strangers.push_back(std::make_unique<WsClient>(server.port, path));
  for (const auto& one : strangers) EXPECT_TRUE(one->open());
  WsClient one_more(server.port, path);
  EXPECT_EQ(one_more.ended_with(), 4029) << "four of one address, the one that came in not among them";
  WsClient by_header(server.port, path, "Authorization: Bearer " + server.admin + "\r\n");
  by_header.send(1, R"({"event":"subscribe","topic":"location_updates"})");
  const auto at_once = by_header.frame();
  ASSERT_TRUE(at_once);
  EXPECT_NE(at_once->payload.find("subscribed"), std::string::npos);
}

TEST(OmloxAccess, RefusesInTheFormOfOmlox) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  for (const auto& headers : {std::map<std::string, std::string>{}, server.bearer("anc_wrong")}) {
    const auto answer = server.call("GET", "/omlox/v2/zones", {}, headers);
    EXPECT_EQ(answer.status, 401);
    EXPECT_EQ(answer.headers.at("content-type"), "application/json");
    EXPECT_NE(answer.body.find(R"("code":401)"), std::string::npos) << answer.body;
  }
}

TEST(LiveAccess, SaysByeWhenTheServerStops) {
  AppFixture server(Settings{{"auth", "off"}});
  ASSERT_TRUE(server.app) << server.error.message;
  auto client =
      std::make_unique<WsClient>(server.port, "/api/v1/ws", "Sec-WebSocket-Protocol: anchord.v1\r\n");
  ASSERT_TRUE(client->open());
  const auto begin = std::chrono::steady_clock::now();
  std::thread stopper([&] { server.app->stop(); });
  EXPECT_EQ(client->ended_with(), 4010);
  client->send(8, std::string("\x0f\xaa", 2));
  client.reset();  // as a browser does once it has seen the server's end
  stopper.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(3));
}

TEST(RateLimits, CountsRequestsPerToken) {
  AppFixture server(Settings{{"rate.per_s", "1"}, {"rate.burst", "5"}});
  ASSERT_TRUE(server.app) << server.error.message;
  server::ClientResponse last;
  for (int i = 0; i < 7; ++i) last = server.call("GET", "/api/v1/me", {}, server.bearer(server.admin));
  EXPECT_EQ(last.status, 429);
  EXPECT_EQ(last.headers["retry-after"], "1");
  EXPECT_EQ(server.call("GET", "/healthz").status, 200);
}

TEST(AuthOff, IsRefusedOnOtherAddressesThanLoopback) {
  AppFixture open(Settings{{"listen", "0.0.0.0:0"}, {"auth", "off"}, {"insecure", "true"}});
  EXPECT_FALSE(open.app);
  EXPECT_EQ(open.error.code, Errc::invalid_argument);
  AppFixture mixed(Settings{{"listen", "127.0.0.1:0,0.0.0.0:0"}, {"auth", "off"}});
  EXPECT_FALSE(mixed.app);
}

TEST(Listening, NeedsInsecureBeyondLoopback) {
  AppFixture plain(Settings{{"listen", "0.0.0.0:0"}});
  EXPECT_FALSE(plain.app);
  AppFixture insecure(Settings{{"listen", "0.0.0.0:0"}, {"insecure", "true"}});
  EXPECT_TRUE(insecure.app) << insecure.error.message;
  AppFixture aircraft(Settings{{"drone.address", "udp://0.0.0.0:0"}});
  EXPECT_FALSE(aircraft.app) << "whoever reaches the link flies the aircraft";
  EXPECT_NE(aircraft.error.message.find("--drone-signing-key-file"), std::string::npos)
      << aircraft.error.message;
  AppFixture known(Settings{{"drone.address", "udp://0.0.0.0:0"}, {"insecure", "true"}});
  EXPECT_TRUE(known.app) << known.error.message;
}

TEST(AuthOff, StillRefusesForeignPagesAndPlainForms) {
  AppFixture server(Settings{{"auth", "off"}});
  ASSERT_TRUE(server.app) << server.error.message;
  EXPECT_EQ(server.call("GET", "/api/v1/missions").status, 200);
  EXPECT_EQ(server.call("POST", "/api/v1/missions", "{}", {{"Origin", "http://evil.example"}}).status, 403);
  auto client = server::HttpClient::to(server.url).value();
  EXPECT_EQ(
      client.call("POST", "/api/v1/missions", "a=b", "application/x-www-form-urlencoded").value().status,
      415);
}

TEST(StartUp, IsReadyWithin300MillisecondsOnAnEmptyFolder) {
  const auto begin = std::chrono::steady_clock::now();
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  EXPECT_EQ(server.call("GET", "/readyz").status, 200);
  const auto took =
      std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begin);
  RecordProperty("ready_ms", static_cast<int>(took.count()));
  std::printf("ready after %d ms\n", static_cast<int>(took.count()));
  EXPECT_LT(took.count(), 3000) << "ten times the promise, for loaded machines";
}

TEST(StartUp, RefusesAFolderThatIsInUse) {
  AppFixture first;
  ASSERT_TRUE(first.app) << first.error.message;
  const auto config = server::load_config(
      {{"listen", "127.0.0.1:0"}, {"data_dir", (first.folder / "data").string()}}, std::nullopt, {});
  const auto second = server::App::start(config.value());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::conflict);
}

}  // namespace
}  // namespace anchord::test::access_over_http_test
