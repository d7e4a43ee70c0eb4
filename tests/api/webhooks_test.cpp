// Webhooks against a real HTTP server of somebody else's (cpp-httplib): what is sent, signed, sent again, and
// what never is.
#include <condition_variable>

#include "api/webhooks/cloud_event.hpp"
#include "app_fixture.hpp"
#include "core/base/locked.hpp"
#include "core/base/to_wire.hpp"
#include "server/http/public_address.hpp"
#include "server/http/web_post.hpp"
// Last: it brings <resolv.h>, whose macro `_res` breaks Eigen's headers.
#include <httplib.h>

namespace anchord::test::webhooks_test {
namespace {

using api::Method;
using api::Role;
using namespace std::chrono_literals;

/// What somebody receives at POST /hook; answers with the next status of `answers`, then with 204.
class Receiver {
 public:
  struct Letter {
    std::string body, id, timestamp, signature, type;
  };
  explicit Receiver(std::vector<int> answers = {}, int port = 0) : answers_(std::move(answers)) {
    server_.Post("/hook", [this](const httplib::Request& request, httplib::Response& response) {
      auto letters = letters_.lock();
      letters->push_back({request.body, request.get_header_value("webhook-id"),
                          request.get_header_value("webhook-timestamp"),
                          request.get_header_value("webhook-signature"),
                          request.get_header_value("Content-Type")});
      const auto n = letters->size() - 1;
      response.status = n < answers_.size() ? answers_[n] : 204;
      if (response.status == 302) response.set_header("Location", "/elsewhere");
      came_.notify_all();
      letters.wait(came_, [this](const auto&) { return !held_; });
    });
    server_.set_error_handler([this](const httplib::Request& request, httplib::Response&) {
      if (request.path == "/elsewhere") elsewhere_ = true;
    });
    port_ = port == 0 ? server_.bind_to_any_port("127.0.0.1")
                      : (server_.bind_to_port("127.0.0.1", port) ? port : -1);
    EXPECT_GT(port_, 0);
    thread_ = Thread("receiver", [this] { server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::yield();  // else stop() finds nothing to end
  }
  ~Receiver() {
    release();
    stop();
  }
  void stop() {
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }
  /// Takes letters and does not answer them, until release().
  void hold() { held_ = true; }
  void release() {
    {
      const auto letters = letters_.lock();
      held_ = false;
    }
    came_.notify_all();
  }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/hook"; }
  int port() const { return port_; }
  bool elsewhere() const { return elsewhere_; }
  /// The first n letters, once they came.
  std::vector<Letter> letters(std::size_t n) {
    auto letters = letters_.lock();
    EXPECT_TRUE(letters.wait_for(came_, 20s, [n](const auto& all) { return all.size() >= n; }))
        << letters->size();
    return *letters;
  }

 private:
  std::vector<int> answers_;
  httplib::Server server_;
  Locked<std::vector<Letter>> letters_;
  std::condition_variable came_;
  std::atomic<bool> elsewhere_{false}, held_{false};
  int port_{};
  Thread thread_;
};

class Webhooks : public AppFixture {
 protected:
  void configure(api::Application::Deps& deps) override {
    post_ = server::make_web_post(allow_private_);
    deps.web_post = post_.get();
    deps.webhook_waits_s = waits_s_;
  }
  Json hook(const std::string& url, const Json& more = Json::object()) {
    Json body{{"name", "facility system"}, {"url", url}};
    body.update(more);
    const auto made = post("/api/v1/webhooks", body.dump());
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made);
  }
  std::string finished_mission() {
    const auto id = mission();
    EXPECT_EQ(post("/api/v1/missions/" + id + "/actions", R"({"action":"finish"})").status, 200);
    return id;
  }
  /// The newest delivery once it is in this state.
  Json delivery(const Json& hook, const std::string& state) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    Json newest;
    do {
      const auto all =
          json(get("/api/v1/webhooks/" + hook["id"].get<std::string>() + "/deliveries"))["items"];
      if (!all.empty()) newest = all[0];
      if (!newest.is_null() && newest["state"] == state) return newest;
      std::this_thread::yield();
    } while (std::chrono::steady_clock::now() < end);
    ADD_FAILURE() << "not " << state << ": " << newest;
    return newest;
  }
  bool allow_private_{true};
  std::vector<double> waits_s_{0.01, 0.01, 0.01};
  std::unique_ptr<WebPost> post_;
};

// The example of the Standard Webhooks specification 1.0, "Signature scheme".
TEST(WebhookSignature, IsThatOfThePublishedExample) {
  EXPECT_EQ(api::webhook_signature("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "msg_p5jXN8AQM9LWM0D4loKWxJek",
                                   1614265330, R"({"test": 2432232314})"),
            "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
}

// IANA special-purpose registries for IPv4 and IPv6; what is public: 1.1.1.1, RIPE, Google.
TEST(PublicAddress, IsNoneOfThisMachineLinkSiteOrTunnel) {
  for (const char* one : {"1.1.1.1", "193.0.6.139", "172.15.255.255", "172.32.0.0", "100.63.255.255",
                          "100.128.0.0", "2001:4860:4860::8888", "2a00:1450::1", "::ffff:1.1.1.1"})
    EXPECT_TRUE(server::is_public_address(one)) << one;
  for (const char* one : {"0.0.0.0",
                          "10.1.2.3",
                          "100.64.0.1",
                          "127.0.0.1",
                          "127.255.255.254",
                          "169.254.169.254",
                          "172.16.0.1",
                          "172.31.255.255",
                          "192.0.0.8",
                          "192.0.2.1",
                          "192.168.1.1",
                          "198.18.0.1",
                          "198.19.255.255",
                          "198.51.100.7",
                          "203.0.113.9",
                          "224.0.0.1",
                          "255.255.255.255",
                          "::",
                          "::1",
                          "::ffff:127.0.0.1",
                          "::ffff:169.254.169.254",
                          "::127.0.0.1",
                          "64:ff9b::7f00:1",
                          "fe80::1",
                          "fe80::1%lo",
                          "fc00::1",
                          "fd12::1",
                          "ff02::1",
                          "2001::1",
                          "2001:db8::1",
                          "2002:7f00:1::1",
                          "localhost",
                          "",
                          "127.1"})
    EXPECT_FALSE(server::is_public_address(one)) << one;
}

TEST_F(Webhooks, APublishedRevisionArrivesAsASignedCloudEvent) {
  Receiver receiver;
  const Json made = hook(receiver.url(), {{"events", {"revision.published"}}});
  const auto calibration = stored_calibration([](Estimate&) {});
  finished_mission();  // not asked for
  ASSERT_EQ(post("/api/v1/calibrations/" + calibration + "/publish", "{}").status, 201);
  const auto letter = receiver.letters(1)[0];
  const Json event = Json::parse(letter.body);
  EXPECT_EQ(event["specversion"], "1.0");
  EXPECT_EQ(event["type"], "anchord.revision.published");
  EXPECT_EQ(event["source"], "/api/v1");
  EXPECT_EQ(event["data"]["text"], "revision 1 with 2 anchors published");
  EXPECT_EQ(letter.type, "application/cloudevents+json; charset=utf-8");
  EXPECT_EQ(letter.signature, api::webhook_signature(made["secret"].get<std::string>(), letter.id,
                                                     std::stoll(letter.timestamp), letter.body));
  const Json told = delivery(made, "delivered");
  EXPECT_EQ(told["id"], letter.id);
  EXPECT_EQ(told["attempts"], 1);
  EXPECT_EQ(told["status"], 204);
}

TEST_F(Webhooks, WhatWasNotTakenIsSentAgainUnderItsIdAndRedirectsAreNotFollowed) {
  Receiver receiver({500, 302});
  const Json made = hook(receiver.url());
  const auto id = finished_mission();
  const auto letters = receiver.letters(3);
  EXPECT_EQ(letters[0].id, letters[1].id);
  EXPECT_EQ(letters[0].id, letters[2].id);
  EXPECT_EQ(Json::parse(letters[2].body)["subject"], "missions/" + id);
  EXPECT_EQ(delivery(made, "delivered")["attempts"], 3);
  EXPECT_FALSE(receiver.elsewhere());
}

TEST_F(Webhooks, ASlowReceiverDelaysNobodyElse) {
  Receiver slow, quick;
  slow.hold();
  const Json to_slow = hook(slow.url()), to_quick = hook(quick.url());
  finished_mission();
  slow.letters(1);  // it has it, and does not answer
  finished_mission();
  finished_mission();
  quick.letters(3);
  const auto newest = [&](const Json& hook) {
    return json(get("/api/v1/webhooks/" + hook["id"].get<std::string>() + "/deliveries"))["items"];
  };
  EXPECT_EQ(delivery(to_quick, "delivered")["attempts"], 1);
  const Json waiting = newest(to_slow);
  ASSERT_EQ(waiting.size(), 3U);
  for (const auto& one : waiting) EXPECT_EQ(one["attempts"], 0) << "the first is still being answered";
  slow.release();
  EXPECT_EQ(delivery(to_slow, "delivered")["status"], 204);
}

TEST_F(Webhooks, AreGivenUpAfterTheLastWait) {
  Receiver receiver({500, 500, 500, 503, 500});
  const Json made = hook(receiver.url());
  finished_mission();
  const Json told = delivery(made, "failed");
  EXPECT_EQ(told["attempts"], 4) << "one, and one for each wait";
  EXPECT_EQ(told["status"], 503);
  EXPECT_EQ(told["fault"], "answered 503");
}

TEST_F(Webhooks, TheOutboxOutlivesTheProcess) {
  waits_s_ = {3600};
  int port = 0;
  {
    Receiver before;
    port = before.port();
  }
  restart();
  const Json made = hook("http://127.0.0.1:" + std::to_string(port) + "/hook");
  finished_mission();
  const auto end = std::chrono::steady_clock::now() + 20s;
  const auto attempts = [&] {
    const auto all = json(get("/api/v1/webhooks/" + made["id"].get<std::string>() + "/deliveries"))["items"];
    return all.empty() ? 0 : all[0]["attempts"].get<int>();
  };
  while (attempts() == 0 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  EXPECT_EQ(attempts(), 1);
  EXPECT_EQ(delivery(made, "pending")["status"], nullptr);
  close();
  Receiver receiver({}, port);
  open();
  // The wait is of running time, so the test does not wait for it: a test event goes now, the other stays
  // due.
  ASSERT_EQ(post("/api/v1/webhooks/" + made["id"].get<std::string>() + "/test", "").status, 202);
  EXPECT_EQ(Json::parse(receiver.letters(1)[0].body)["type"], "anchord.webhook.test");
  const auto all = json(get("/api/v1/webhooks/" + made["id"].get<std::string>() + "/deliveries"))["items"];
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[1]["event"], "mission.finished");
  EXPECT_EQ(all[1]["state"], "pending");
}

TEST_F(Webhooks, GoNowhereOnThisMachineUnlessAllowed) {
  allow_private_ = false;
  waits_s_ = {3600};
  restart();
  Receiver receiver;
  const auto port = std::to_string(receiver.port());
  // Whatever way the address is written, and by a name that resolves to it.
  for (const std::string host :
       {"127.0.0.1", "localhost", "[::1]", "127.1", "2130706433", "[::ffff:127.0.0.1]"}) {
    const auto sent = post_->post({"http://" + host + ':' + port + "/hook", {}, "{}"});
    ASSERT_FALSE(sent) << host;
    EXPECT_NE(sent.error().code, Errc::canceled) << host;
  }
  const Json made = hook("http://127.0.0.1:" + port + "/hook");
  finished_mission();
  const auto end = std::chrono::steady_clock::now() + 20s;
  Json told = delivery(made, "pending");
  while (told["fault"].is_null() && std::chrono::steady_clock::now() < end) told = delivery(made, "pending");
  EXPECT_NE(told["fault"].dump().find("to allow it, set webhooks.allow_private"), std::string::npos) << told;
  EXPECT_EQ(receiver.letters(0).size(), 0U);
}

TEST_F(Webhooks, RefuseAddressesThatAreNone) {
  for (const char* url : {"ftp://a.example/", "https://", "https://user:pass@a.example/",
                          "https://a.example/#x", "file:///etc/passwd", "https://a.example:0/",
                          "https://a.example:99999/", "gopher://a", "https://a.example/\nHost: b"}) {
    const auto made = post("/api/v1/webhooks", Json{{"name", "x"}, {"url", url}}.dump());
    EXPECT_EQ(made.status, 422) << url;
    EXPECT_EQ(json(made)["errors"][0]["pointer"], "/url") << url;
  }
  EXPECT_EQ(post("/api/v1/webhooks", R"({"name":"x","url":"https://a.example/","events":["range.received"]})")
                .status,
            422);
  EXPECT_EQ(post("/api/v1/webhooks", R"({"name":"x"})").status, 422);
}

TEST_F(Webhooks, TheSecretIsToldOnceAndChangesNeedTheNewestVersion) {
  const Json made = hook("https://a.example/hook");
  ASSERT_TRUE(made["secret"].get<std::string>().starts_with("whsec_"));
  const auto path = "/api/v1/webhooks/" + made["id"].get<std::string>();
  EXPECT_FALSE(json(get(path)).contains("secret"));
  EXPECT_EQ(get("/api/v1/webhooks").body.find("whsec_"), std::string::npos);
  Call change;
  EXPECT_EQ(call(Method::patch, path, R"({"enabled":false})", change).status, 428);
  change.headers["if-match"] = header(get(path), "ETag");
  EXPECT_EQ(call(Method::patch, path, R"({"enabled":false})", change).status, 200);
  EXPECT_EQ(call(Method::patch, path, R"({"enabled":true})", change).status, 412);
  EXPECT_EQ(post(path + "/test", "").status, 422) << "it is off";
  change.headers["if-match"] = header(get(path), "ETag");
  EXPECT_EQ(call(Method::del, path, "", change).status, 204);
  EXPECT_EQ(get(path).status, 404);
}

TEST_F(Webhooks, AreInTheAuditLogWithoutWhatMayBeAKeyOfTheirUrl) {
  const Json made = hook("https://a.example:8443/hook/in?token=abcdef&x=1");
  const auto path = "/api/v1/webhooks/" + made["id"].get<std::string>();
  Call change;
  change.headers["if-match"] = "*";
  EXPECT_EQ(call(Method::patch, path, R"({"url":"https://a.example/other?token=ghijkl"})", change).status,
            200);
  EXPECT_EQ(call(Method::del, path, "", change).status, 204);
  const auto log = get("/api/v1/audit").body;
  EXPECT_NE(log.find("https://a.example:8443/hook/in"), std::string::npos) << log;
  EXPECT_NE(log.find("https://a.example/other"), std::string::npos) << log;
  for (const char* key : {"token=", "abcdef", "ghijkl"}) EXPECT_EQ(log.find(key), std::string::npos) << log;
}

TEST_F(Webhooks, AreForIntegratorsAndAdministrators) {
  std::size_t n = 0;
  for (const auto& route : app_->router().routes()) {
    if (!route.pattern.starts_with("/api/v1/webhooks")) continue;
    ++n;
    for (const Role role : {Role::integrator, Role::admin})
      EXPECT_TRUE(route.access.permits({"x", "x", {role}}));
    for (const Role role : {Role::viewer, Role::gateway, Role::engineer, Role::op})
      EXPECT_FALSE(route.access.permits({"x", "x", {role}})) << route.pattern << ' ' << to_string(role);
    EXPECT_FALSE(route.access.permits({"x", "x", {}}));
  }
  EXPECT_EQ(n, 7U);
}

}  // namespace
}  // namespace anchord::test::webhooks_test
