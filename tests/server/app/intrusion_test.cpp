// Strangers beside an operator: guesses, logins that ended, sockets and streams without number, a slow disk.
#include <sqlite3.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <thread>

#include "api/kit/router.hpp"
#include "server/app/proxies.hpp"
#include "tests/server/app/app_fixture.hpp"
#include "tests/server/http/ws_client.hpp"

namespace anchord::test::intrusion_test {
namespace {

using std::chrono::milliseconds;

std::string login_body(const std::string& token) { return R"({"token":")" + token + R"("})"; }

/// The same public part, another secret.
std::string wrong_secret_of(const std::string& token) { return token.substr(0, 37) + std::string(64, 'f'); }

std::string cookie_of(const server::ClientResponse& login) {
  const auto& set = login.headers.at("set-cookie");
  return set.substr(0, set.find(';'));
}

std::string bearer_line(const std::string& token) { return "Authorization: Bearer " + token + "\r\n"; }

/// An id in the answer's Location.
std::string location(const server::ClientResponse& answer) { return answer.headers.at("location"); }

std::string new_mission(AppFixture& server, const std::map<std::string, std::string>& headers) {
  return location(server.call("POST", "/api/v1/missions",
                              R"({"name":"flight","frame":"wgs84","track_point":"tag_antenna"})", headers));
}

bool subscribe(WsClient& client, const std::string& topic) {
  client.send(1, R"({"op":"sub","id":1,"topic":")" + topic + R"("})");
  while (const auto frame = client.frame()) {
    if (frame->payload.find(R"("op":"ack")") != std::string::npos) return true;
  }
  return false;
}

bool receives(WsClient& client, const std::string& text) {
  while (const auto frame = client.frame()) {
    if (frame->opcode == 8) return false;
    if (frame->payload.find(text) != std::string::npos) return true;
  }
  return false;
}

// A hundred clients where the setting allows more than 64, and one message: freed memory, or an endless loop.
TEST(LiveClients, AHundredAreServedWhereTheSettingAllowsThemAndLeaveNothingBehind) {
  AppFixture server(Settings{{"auth", "off"}, {"ws.max_connections", "200"}});
  ASSERT_TRUE(server.app) << server.error.message;
  for (int round = 0; round < 2; ++round) {
    std::vector<std::unique_ptr<WsClient>> clients;
    for (int i = 0; i < 100; ++i) {
      clients.push_back(std::make_unique<WsClient>(server.port, "/api/v1/ws"));
      ASSERT_TRUE(clients.back()->open()) << i;
      ASSERT_TRUE(subscribe(*clients.back(), "events")) << i;
    }
    const auto mission = new_mission(server, {});
    for (auto& client : clients) ASSERT_TRUE(receives(*client, mission.substr(mission.rfind('/') + 1)));
    // Half of them vanish without a word.
    for (std::size_t i = 0; i < clients.size(); i += 2) clients[i]->send(8, std::string("\x03\xe8", 2));
  }
  new_mission(server, {});
  EXPECT_EQ(server.call("GET", "/api/v1/system").status, 200);
}

// 2 000 come and go over real sockets while rows stream: some say goodbye, some vanish, some never read.
TEST(LiveClients, TwoThousandComeAndGoWhileRowsStream) {
  AppFixture server(Settings{{"auth", "off"},
                             {"ws.max_connections", "300"},
                             {"ws.per_token", "300"},
                             {"http.max_per_address", "2000"},
                             {"rate.per_s", "100000"},
                             {"rate.burst", "100000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto mission = new_mission(server, {});
  const auto id = mission.substr(mission.rfind('/') + 1);
  constexpr int k_threads = 4, k_each = 500, k_kept = 25;
  std::atomic<int> served{0};
  std::vector<std::thread> crowd;
  for (int t = 0; t < k_threads; ++t) {
    crowd.emplace_back([&, t] {
      std::deque<std::unique_ptr<WsClient>> here;
      for (int i = 0; i < k_each; ++i) {
        auto client = std::make_unique<WsClient>(server.port, "/api/v1/ws");
        if (client->open() && subscribe(*client, i % 2 == 0 ? "ranges" : "fixes")) ++served;
        here.push_back(std::move(client));
        if (here.size() < k_kept) continue;
        if ((i + t) % 3 == 0) here.front()->send(8, std::string("\x03\xe8", 2));
        here.pop_front();
      }
    });
  }
  std::atomic<bool> flying{true};
  std::thread stream([&] {
    auto client = server::HttpClient::to(server.url).value();
    for (int i = 0; flying; ++i) {
      std::string rows;
      for (int k = 0; k < 20; ++k) {
        rows += R"({"t_us":)" + std::to_string(1'780'000'000'000'000 + (i * 20 + k) * 10'000LL) +
                R"(,"tag":"0x6e02","anchor":"0x6a21","distance_m":5})" + "\n";
      }
      EXPECT_EQ(
          client.call("POST", "/api/v1/ranges?mission=" + id, rows, "application/x-ndjson").value().status,
          200);
    }
  });
  for (auto& one : crowd) one.join();
  flying = false;
  stream.join();
  EXPECT_EQ(served, k_threads * k_each);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::string metrics;
  do {
    metrics = server.call("GET", "/metrics").body;
  } while (metrics.find("anchord_ws_clients 0\n") == std::string::npos &&
           std::chrono::steady_clock::now() < end);
  EXPECT_NE(metrics.find("anchord_ws_clients 0\n"), std::string::npos) << "all places came back";
}

TEST(LiveClients, OneTokenDoesNotTakeThePlacesOfOthersAndOperatorsHaveSomeOfTheirOwn) {
  AppFixture server(Settings{
      {"ws.max_connections", "8"}, {"ws.per_token", "4"}, {"ws.reserved", "2"}, {"rate.burst", "1000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto greedy = bearer_line(server.token(R"(["viewer"])")),
             other = bearer_line(server.token(R"(["viewer"])"));
  const auto pilot = bearer_line(server.token(R"(["operator"])"));
  std::vector<std::unique_ptr<WsClient>> clients;
  const auto ends = [&](const std::string& headers) {
    clients.push_back(std::make_unique<WsClient>(server.port, "/api/v1/ws", headers));
    const auto first = clients.back()->frame();
    return first ? first->close_code() : -1;
  };
  for (int i = 0; i < 4; ++i) EXPECT_EQ(ends(greedy), 0) << i;
  EXPECT_EQ(ends(greedy), 4029) << "the token has all of its own";
  for (int i = 0; i < 2; ++i) EXPECT_EQ(ends(other), 0) << i;
  EXPECT_EQ(ends(other), 1013) << "the rest is for operators";
  for (int i = 0; i < 2; ++i) EXPECT_EQ(ends(pilot), 0) << i;
  EXPECT_EQ(ends(pilot), 1013) << "and no more than there are";
  clients.clear();
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  int code = 1013;
  while (code != 0 && std::chrono::steady_clock::now() < end) code = ends(greedy);
  EXPECT_EQ(code, 0) << "places come back";
}

TEST(EndedLogins, CloseTheStreamsOfARevokedToken) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto made = server.call("POST", "/api/v1/tokens", R"({"name":"x","roles":["viewer"]})",
                                server.bearer(server.admin));
  const std::string token = made.body.substr(made.body.find("anc_"), 101);
  const auto opened = server.call("POST", "/api/v1/session", login_body(token));
  const std::string cookie = "Cookie: " + cookie_of(opened) + "\r\n";
  const auto ticket_answer = server.call("POST", "/api/v1/ws-tickets", "{}", server.bearer(token));
  const std::string ticket = ticket_answer.body.substr(ticket_answer.body.find(R"("ticket":")") + 10, 64);
  WsClient by_token(server.port, "/api/v1/ws", bearer_line(token)),
      by_cookie(server.port, "/api/v1/ws", cookie);
  WsClient of_admin(server.port, "/api/v1/ws", bearer_line(server.admin));
  ASSERT_TRUE(subscribe(by_token, "system"));
  ASSERT_TRUE(subscribe(by_cookie, "system"));
  ASSERT_TRUE(subscribe(of_admin, "system"));
  ASSERT_EQ(server.call("DELETE", location(made), {}, server.bearer(server.admin)).status, 204);
  const auto revoked = std::chrono::steady_clock::now();
  EXPECT_EQ(by_token.ended_with(), 4001);
  EXPECT_EQ(by_cookie.ended_with(), 4001);
  EXPECT_LT(std::chrono::steady_clock::now() - revoked, std::chrono::seconds(5)) << "promised: 1 s";
  WsClient late(server.port, "/api/v1/ws?ticket=" + ticket);
  EXPECT_EQ(status_of(late.handshake), 401) << "a ticket of before is worth as much as its token";
  EXPECT_TRUE(receives(of_admin, R"("op":"data")")) << "others stay";
}

TEST(EndedLogins, CloseTheStreamsOfASessionAtLogoutAndLeaveTheOthersOfItsToken) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto one = server.call("POST", "/api/v1/session", login_body(server.admin));
  const auto two = server.call("POST", "/api/v1/session", login_body(server.admin));
  WsClient first(server.port, "/api/v1/ws", "Cookie: " + cookie_of(one) + "\r\n");
  WsClient second(server.port, "/api/v1/ws", "Cookie: " + cookie_of(two) + "\r\n");
  ASSERT_TRUE(subscribe(first, "system"));
  ASSERT_TRUE(subscribe(second, "system"));
  ASSERT_EQ(
      server.call("DELETE", "/api/v1/session", {}, {{"Cookie", cookie_of(one)}, {"X-Anchord", "1"}}).status,
      204);
  EXPECT_EQ(first.ended_with(), 4001);
  EXPECT_TRUE(receives(second, R"("op":"data")"));
}

TEST(EndedLogins, CloseTheStreamsOfATokenThatExpires) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto until = to_rfc3339({SystemClock{}.now().ns + 2'000'000'000});
  const auto made = server.call("POST", "/api/v1/tokens",
                                R"({"name":"x","roles":["viewer"],"expires_at":")" + until + R"("})",
                                server.bearer(server.admin));
  ASSERT_EQ(made.status, 201) << made.body;
  WsClient client(server.port, "/api/v1/ws", bearer_line(made.body.substr(made.body.find("anc_"), 101)));
  ASSERT_TRUE(client.open());
  EXPECT_EQ(client.ended_with(), 4001);
}

TEST(Guesses, OfAStrangerDoNotLockTheOperatorOutBehindAProxy) {
  AppFixture server(Settings{{"trusted_proxies", "127.0.0.1"}, {"rate.burst", "100000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const std::map<std::string, std::string> stranger{{"X-Forwarded-For", "203.0.113.9"}},
      field{{"X-Forwarded-For", "198.51.100.7"}};
  const auto guess = login_body(wrong_secret_of(server.admin));
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(server.call("POST", "/api/v1/session", guess, stranger).status, 401) << i;
  for (int i = 0; i < 20; ++i)
    EXPECT_EQ(server.call("POST", "/api/v1/session", guess, stranger).status, 429) << i;
  EXPECT_EQ(server.call("POST", "/api/v1/session", guess, field).status, 401) << "a mistake of another place";
  EXPECT_EQ(server.call("POST", "/api/v1/session", login_body(server.admin), field).status, 200);
  EXPECT_EQ(server.call("POST", "/api/v1/session", login_body(server.admin), stranger).status, 200)
      << "what is right is never refused, wherever it comes from";
  // The audit log names who asked, not the proxy.
  const auto audit = server.call("GET", "/api/v1/audit", {}, server.bearer(server.admin)).body;
  EXPECT_NE(audit.find("203.0.113.9"), std::string::npos) << audit;
}

TEST(Guesses, CannotChangeTheirAddressByAHeaderThatNobodyTrusts) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto guess = login_body(wrong_secret_of(server.admin));
  int last = 0;
  for (int i = 0; i < 6; ++i) {
    last =
        server.call("POST", "/api/v1/session", guess, {{"X-Forwarded-For", "203.0.113." + std::to_string(i)}})
            .status;
  }
  EXPECT_EQ(last, 429);
}

TEST(Guesses, InHeadersAndTicketsAreSlowedAndValidOnesAreNot) {
  AppFixture server(Settings{{"rate.burst", "100000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  int refused = 0, slowed = 0;
  for (int i = 0; i < 500; ++i) {
    const std::string digits = std::to_string(100'000 + i);
    const int status =
        server
            .call("GET", "/api/v1/me", {},
                  server.bearer("anc_" + std::string(26, '0') + digits + "_" + std::string(64, 'a')))
            .status;
    ++(status == 429 ? slowed : refused);
    if (i % 50 == 0) {
      EXPECT_EQ(server.call("GET", "/api/v1/me", {}, server.bearer(server.admin)).status, 200);
    }
  }
  // 20 a minute of one address, and a few for the time this takes.
  EXPECT_LT(refused, 60);
  EXPECT_GT(slowed, 400);
  WsClient ticket(server.port, "/api/v1/ws?ticket=" + std::string(64, 'b'));
  EXPECT_EQ(status_of(ticket.handshake), 429);
  const auto made = server.call("POST", "/api/v1/ws-tickets", "{}", server.bearer(server.admin));
  WsClient good(server.port,
                "/api/v1/ws?ticket=" + made.body.substr(made.body.find(R"("ticket":")") + 10, 64));
  EXPECT_TRUE(good.open());
}

TEST(IdleSockets, OfOneAddressDoNotStarveAWorkingOperator) {
  AppFixture server(Settings{{"http.max_connections", "300"}, {"http.max_per_address", "250"}});
  ASSERT_TRUE(server.app) << server.error.message;
  auto client = server::HttpClient::to(server.url).value();
  client.set_header("Authorization", "Bearer " + server.admin);
  EXPECT_EQ(client.call("GET", "/api/v1/me").value().status, 200);
  std::vector<std::unique_ptr<RawSocket>> idle;
  for (int i = 0; i < 600; ++i) {
    idle.push_back(std::make_unique<RawSocket>(server.port));
    if (i % 100 == 0) {
      EXPECT_EQ(client.call("GET", "/api/v1/me").value().status, 200) << i;
    }
    if (i % 50 == 0) {
      EXPECT_EQ(server.call("GET", "/api/v1/me", {}, server.bearer(server.admin)).status, 200) << i;
    }
  }
}

TEST(TrustedProxies, NameTheLastAddressThatIsNoProxyOfOurs) {
  const auto some = server::TrustedProxies::parse({"127.0.0.1", "10.0.0.0/8", "2001:db8::/32"});
  ASSERT_TRUE(some) << some.error().message;
  const auto& proxies = some.value();
  EXPECT_EQ(proxies.client("127.0.0.1", "203.0.113.9"), "203.0.113.9");
  EXPECT_EQ(proxies.client("127.0.0.1", "203.0.113.9, 10.1.2.3"), "203.0.113.9");
  EXPECT_EQ(proxies.client("10.255.0.1", "198.51.100.7, 203.0.113.9"), "203.0.113.9")
      << "what the client wrote itself";
  EXPECT_EQ(proxies.client("2001:db8::1", "2001:db8:1::2, [2001:db9::1]"), "[2001:db9::1]");
  EXPECT_EQ(proxies.client("192.0.2.1", "203.0.113.9"), "192.0.2.1") << "no proxy of ours";
  EXPECT_EQ(proxies.client("11.0.0.1", "203.0.113.9"), "11.0.0.1");
  EXPECT_EQ(proxies.client("127.0.0.1", ""), "127.0.0.1");
  EXPECT_EQ(proxies.client("127.0.0.1", "nonsense, <script>"), "127.0.0.1");
  EXPECT_EQ(proxies.client("127.0.0.1", "203.0.113.9, nonsense, 10.0.0.1"), "10.0.0.1");
  for (const char* bad : {"localhost", "10.0.0.0/33", "10.0.0.0/x", "::/129", "", "/8"})
    EXPECT_FALSE(server::TrustedProxies::parse({bad})) << bad;
  EXPECT_FALSE(server::TrustedProxies{}.trusts("127.0.0.1"));
}

TEST(RateLimits, OfWhatAPageAsksLeaveCommandsAndLoginsTheirOwn) {
  AppFixture server(Settings{{"rate.per_s", "1"}, {"rate.burst", "5"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto admin = server.bearer(server.admin);
  const auto mission = new_mission(server, admin);
  // One request a second comes back: as fast as one connection asks, whatever else the machine does.
  const auto used_up = [&](const std::map<std::string, std::string>& headers) {
    auto client = server::HttpClient::to(server.url).value();
    for (const auto& [name, value] : headers) client.set_header(name, value);
    for (int i = 0; i < 1000; ++i) {
      if (client.call("GET", "/api/v1/me").value().status == 429) return true;
    }
    return false;
  };
  EXPECT_TRUE(used_up(admin));
  EXPECT_EQ(server.call("POST", mission + "/control", R"({"action":"take"})", admin).status, 200);
  EXPECT_EQ(server.call("POST", mission + "/actions", R"({"action":"land"})", admin).status, 409);
  EXPECT_TRUE(used_up({})) << "an address without a login";
  EXPECT_EQ(server.call("POST", "/api/v1/session", login_body(server.admin)).status, 200);
}

TEST(RouteTable, DeclaresTheExecutorOfWhatKeepsAnAircraftSafeAndOfWhatComputes) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  using api::Work;
  const std::map<std::string, Work> expected{{"GET /readyz", Work::command},
                                             {"GET /api/v1/alarms", Work::command},
                                             {"POST /api/v1/alarms/{id}/ack", Work::command},
                                             {"GET /api/v1/missions/{id}/control", Work::command},
                                             {"POST /api/v1/missions/{id}/control", Work::command},
                                             {"GET /api/v1/missions/{id}/checklist", Work::flight},
                                             {"POST /api/v1/missions/{id}/uploads", Work::flight},
                                             {"POST /api/v1/plans/generate", Work::heavy},
                                             {"POST /api/v1/plans/validate", Work::heavy},
                                             {"POST /api/v1/plans/{id}/validate", Work::heavy},
                                             {"POST /api/v1/transform", Work::heavy},
                                             {"POST /api/v1/models/{id}/predict", Work::heavy},
                                             {"POST /api/v1/models/{id}/promote", Work::heavy},
                                             {"POST /api/v1/datasets", Work::heavy},
                                             {"GET /api/v1/calibrations/{id}/report", Work::heavy},
                                             {"GET /api/v1/missions/{id}/track", Work::heavy},
                                             {"GET /api/v1/ranges", Work::heavy}};
  std::size_t found = 0;
  for (const auto& route : server.app->router().routes()) {
    const std::string name = std::string(api::to_string(route.method)) + ' ' + route.pattern;
    if (const auto at = expected.find(name); at != expected.end()) {
      ++found;
      EXPECT_EQ(route.work, at->second) << name;
    }
    if (route.pattern.starts_with("/api/v1/exports/")) {
      EXPECT_EQ(route.work, Work::heavy) << name;
    }
    if (name != "POST /api/v1/missions/{id}/actions") continue;
    api::Request request;
    for (const char* action : {"hold", "land", "abort", "return", "resume", "skip", "nonsense"}) {
      request.body = R"({"action":")" + std::string(action) + R"("})";
      EXPECT_EQ(route.work_for(request), Work::command) << action;
    }
    for (const char* action : {"start", "finish"}) {
      request.body = R"({"action":")" + std::string(action) + R"("})";
      EXPECT_EQ(route.work_for(request), Work::flight) << action;
    }
    for (const char* body : {"", "[]", "{", R"({"action":7})"}) {
      request.body = body;
      EXPECT_EQ(route.work_for(request), Work::command) << body;
    }
  }
  EXPECT_EQ(found, expected.size());
}

// A commit may take as long as the disk likes: a command is answered, and its line in the audit log follows.
TEST(Commands, AreAnsweredWhileTheDatabaseTakesNoWrite) {
  AppFixture server(Settings{{"rate.burst", "1000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto pilot = server.bearer(server.token(R"(["operator"])"));
  const auto mission = new_mission(server, pilot);
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open((server.folder / "data" / "anchord.db").c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(other);
  std::atomic<bool> written{false};
  std::thread writer([&] {
    new_mission(server, pilot);
    written = true;
  });
  auto with_key = pilot;
  with_key["Idempotency-Key"] = "take-1";
  const auto taken = server.call("POST", mission + "/control", R"({"action":"take"})", with_key);
  EXPECT_EQ(taken.status, 200) << taken.body;
  const auto again = server.call("POST", mission + "/control", R"({"action":"take"})", with_key);
  EXPECT_EQ(again.body, taken.body) << "the answer that is not on the disk yet is known";
  const auto at = taken.body.find(R"("lease":")") + 9;
  const std::string lease = taken.body.substr(at, taken.body.find('"', at) - at);
  for (const char* action : {"hold", "land", "abort"}) {
    const auto answer =
        server.call("POST", mission + "/actions",
                    R"({"action":")" + std::string(action) + R"(","lease":")" + lease + R"("})", pilot);
    // Hold and land are always sent; what is not flown cannot be aborted.
    EXPECT_EQ(answer.status, std::string_view(action) == "abort" ? 422 : 202) << action << answer.body;
  }
  EXPECT_EQ(server.call("GET", "/api/v1/alarms", {}, pilot).status, 200);
  EXPECT_FALSE(written) << "the test holds the database: what must be on the disk waits";
  ASSERT_EQ(sqlite3_exec(other, "ROLLBACK", nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(other);
  writer.join();
  std::string audit;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  do {
    audit = server.call("GET", "/api/v1/audit", {}, server.bearer(server.admin)).body;
  } while (audit.find("mission.abort") == std::string::npos && std::chrono::steady_clock::now() < end);
  for (const char* line : {"control.take", "mission.hold", "mission.land", "mission.abort"})
    EXPECT_NE(audit.find(line), std::string::npos) << line;
}

}  // namespace
}  // namespace anchord::test::intrusion_test
