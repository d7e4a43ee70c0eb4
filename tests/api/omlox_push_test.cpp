// Push to omlox hubs, against a stand-in by somebody else's HTTP server (cpp-httplib) that behaves as the two
// dialects do: what is made, what is changed, what is sent again, and what outlives the process.
#include <condition_variable>
#include <deque>

#include "core/base/locked.hpp"
#include "core/base/to_wire.hpp"
#include "omlox_fixture.hpp"
#include "server/http/web_post.hpp"
// Last: it brings <resolv.h>, whose macro `_res` breaks Eigen's headers.
#include <httplib.h>

namespace anchord::test::omlox_push_test {
namespace {

using api::Method;
using namespace std::chrono_literals;

/// Keeps objects of lists under their id. Answers what is scripted for a method and list first.
class StandInHub {
 public:
  struct Seen {
    std::string method, path, body, token;
  };
  /// own_ids: a zone that is made gets an id of the hub, as hub API 2.0.0 says.
  explicit StandInHub(bool own_ids = false, int port = 0) : own_ids_(own_ids) {
    const auto answer = [this](const httplib::Request& request, httplib::Response& response) {
      auto state = state_.lock();
      state->seen.push_back(
          {request.method, request.target, request.body, request.get_header_value("Authorization")});
      response.status = status(*state, request, response);
      came_.notify_all();
    };
    server_.Get(".*", answer);
    server_.Put(".*", answer);
    server_.Post(".*", answer);
    port_ = port == 0 ? server_.bind_to_any_port("127.0.0.1")
                      : (server_.bind_to_port("127.0.0.1", port) ? port : -1);
    EXPECT_GT(port_, 0);
    thread_ = Thread("hub", [this] { server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::yield();  // else stop() finds nothing to end
  }
  ~StandInHub() {
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/v2"; }
  int port() const { return port_; }
  /// The next answers to a method of a list, like "POST /zones".
  void script(const std::string& what, std::deque<int> answers) {
    auto state = state_.lock();
    state->scripted[what] = std::move(answers);
  }
  std::vector<Seen> seen() const {
    const auto state = state_.lock();
    return state->seen;
  }
  std::size_t count(const std::string& method, const std::string& list) const {
    const auto all = seen();
    return static_cast<std::size_t>(std::ranges::count_if(
        all, [&](const Seen& one) { return one.method == method && one.path.starts_with("/v2" + list); }));
  }
  Json kept(const std::string& list) const {
    const auto state = state_.lock();
    const auto at = state->lists.find(list);
    return at == state->lists.end() ? Json::object() : at->second;
  }
  /// The newest location that came, once one came that `good` accepts.
  Json location(const std::function<bool(const Json&)>& good) {
    auto state = state_.lock();
    EXPECT_TRUE(state.wait_for(came_, 20s, [&](const State& s) {
      return !s.locations.empty() && good(s.locations.back());
    })) << "no such location came";
    return state->locations.empty() ? Json() : state->locations.back();
  }

 private:
  struct State {
    std::vector<Seen> seen;
    std::map<std::string, std::deque<int>> scripted;
    std::map<std::string, Json> lists;  ///< "/zones": objects by id
    std::vector<Json> locations;
  };
  int status(State& state, const httplib::Request& request, httplib::Response& response) {
    const std::string path = request.path.substr(3);  // behind /v2
    const auto end = path.find('/', 1);
    const std::string list = path.substr(0, end), id = end == std::string::npos ? "" : path.substr(end + 1);
    if (auto& next = state.scripted[request.method + ' ' + list]; !next.empty()) {
      const int out = next.front();
      next.pop_front();
      return out;
    }
    if (id == "locations") {
      for (const auto& one : Json::parse(request.body)) state.locations.push_back(one);
      return request.method == "PUT" ? 204 : 202;
    }
    auto& objects = state.lists[list];
    if (objects.is_null()) objects = Json::object();
    if (request.method == "GET") return get(objects, id, response);
    Json body = Json::parse(request.body);
    if (request.method == "PUT") {
      if (!objects.contains(id)) return 404;
      objects[id] = body;
      return 204;
    }
    if (own_ids_ && list == "/zones")
      body["id"] = "00000000-0000-7000-8000-00000000000" + std::to_string(objects.size());
    const auto key = body["id"].get<std::string>();
    objects[key] = body;
    response.set_content(to_wire(body), "application/json");
    return 201;
  }
  static int get(const Json& objects, const std::string& id, httplib::Response& response) {
    Json all = Json::array();
    for (const auto& [key, value] : objects.items()) all.push_back(value);
    if (!id.empty() && id != "summary" && !objects.contains(id)) return 404;
    response.set_content(to_wire(id.empty() || id == "summary" ? all : objects[id]), "application/json");
    return 200;
  }
  const bool own_ids_;
  httplib::Server server_;
  mutable Locked<State> state_;
  std::condition_variable came_;
  int port_{};
  Thread thread_;
};

class OmloxPush : public OmloxFixture {
 protected:
  void configure(api::Application::Deps& deps) override {
    post_ = server::make_web_post(allow_private_);
    deps.web_post = post_.get();
    deps.webhook_waits_s = waits_s_;
  }
  Json hub(const std::string& url, const Json& more = Json::object()) {
    Json body{{"name", "plant hub"}, {"kind", "omlox_hub"}, {"url", url}};
    body.update(more);
    const auto made = post("/api/v1/webhooks", body.dump());
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made);
  }
  std::string path(const Json& hub) { return "/api/v1/webhooks/" + hub["id"].get<std::string>(); }
  /// The newest delivery once `done` says so.
  Json delivery(const Json& hub, const std::function<bool(const Json&)>& done) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    Json newest;
    do {
      const auto all = json(get(path(hub) + "/deliveries"))["items"];
      if (!all.empty()) newest = all[0];
      if (!newest.is_null() && done(newest)) return newest;
      std::this_thread::yield();
    } while (std::chrono::steady_clock::now() < end);
    ADD_FAILURE() << newest;
    return newest;
  }
  Json delivered(const Json& hub) {
    return delivery(hub, [](const Json& one) { return one["state"] == "delivered"; });
  }
  static bool anywhere(const Json&) { return true; }
  static int free_port() {
    StandInHub gone;
    return gone.port();
  }
  bool allow_private_{true};
  std::vector<double> waits_s_{0.01, 0.01, 0.01};
  std::unique_ptr<WebPost> post_;
};

TEST_F(OmloxPush, APublishedRevisionMakesAZoneAndTheNextChangesIt) {
  StandInHub stand_in;
  fit(hall(square_), square_);
  const Json made = hub(stand_in.url(), {{"dialect", "objects"}});
  publish(square_);
  EXPECT_EQ(delivered(made)["attempts"], 1);
  ASSERT_EQ(stand_in.count("POST", "/zones"), 1U);
  Json zones = stand_in.kept("/zones");
  ASSERT_EQ(zones.size(), 1U);
  EXPECT_EQ(zones.begin().value()["type"], "uwb");
  EXPECT_TRUE(zones.begin().value()["ground_control_points"][0].contains("wgs84"));
  EXPECT_EQ(zones.begin().value()["properties"]["anchord"]["revision"], 2);
  EXPECT_FALSE(stand_in.kept("/providers").empty());
  publish(square_);
  delivery(made, [](const Json& one) {
    return one["event"] == "revision.published" && one["state"] == "delivered";
  });
  const auto end = std::chrono::steady_clock::now() + 20s;
  while (stand_in.count("PUT", "/zones") == 0 && std::chrono::steady_clock::now() < end)
    std::this_thread::yield();
  EXPECT_EQ(stand_in.count("POST", "/zones"), 1U) << "it is changed, not made again";
  EXPECT_EQ(stand_in.kept("/zones").begin().value()["properties"]["anchord"]["revision"], 3);
}

// "The provided id will be replaced by a generated uuid" (POST /zones of hub API 2.0.0).
TEST_F(OmloxPush, AZoneIsFoundAgainWhereTheHubGaveItAnotherId) {
  StandInHub stand_in(true);
  fit(hall(square_), square_);
  const Json made = hub(stand_in.url());
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(post(path(made) + "/test", "").status, 202);
    delivered(made);
  }
  EXPECT_EQ(stand_in.count("POST", "/zones"), 1U);
  ASSERT_EQ(stand_in.kept("/zones").size(), 1U);
  const Json zone = stand_in.kept("/zones").begin().value();
  EXPECT_EQ(zone["id"], "00000000-0000-7000-8000-000000000000") << "it keeps the hub's";
  EXPECT_TRUE(zone["ground_control_points"][0].is_array()) << "official dialect";
}

TEST_F(OmloxPush, AConflictOnMakingIsAChange) {
  StandInHub stand_in;
  fit(hall(square_), square_);
  stand_in.script("GET /zones", {404, 404});
  stand_in.script("POST /zones", {409});
  stand_in.script("PUT /zones", {204});
  const Json made = hub(stand_in.url());
  ASSERT_EQ(post(path(made) + "/test", "").status, 202);
  EXPECT_EQ(delivered(made)["attempts"], 1);
  EXPECT_EQ(stand_in.count("PUT", "/zones"), 1U);
}

TEST_F(OmloxPush, AHubThatFailsIsAskedAgainAndTheLastResultShows) {
  StandInHub stand_in;
  fit(hall(square_), square_);
  stand_in.script("POST /zones", {500, 503});
  const Json made = hub(stand_in.url());
  ASSERT_EQ(post(path(made) + "/test", "").status, 202);
  const Json done = delivered(made);
  EXPECT_EQ(done["attempts"], 3);
  EXPECT_EQ(done["status"].get<int>() / 100, 2);
  EXPECT_EQ(done["fault"], nullptr);
  EXPECT_EQ(stand_in.count("POST", "/zones"), 3U);
  EXPECT_EQ(stand_in.kept("/zones").size(), 1U);
}

TEST_F(OmloxPush, AHubThatKeepsFailingIsGivenUpWithItsAnswer) {
  StandInHub stand_in;
  fit(hall(square_), square_);
  stand_in.script("GET /zones", {401, 401, 401, 401});
  const Json made = hub(stand_in.url(), {{"token", "abc.def"}});
  ASSERT_EQ(post(path(made) + "/test", "").status, 202);
  const Json told = delivery(made, [](const Json& one) { return one["state"] == "failed"; });
  EXPECT_EQ(told["attempts"], 4);
  EXPECT_EQ(told["status"], 401);
  EXPECT_NE(told["fault"].get<std::string>().find("GET /zones/"), std::string::npos) << told;
}

TEST_F(OmloxPush, TheTokenIsSentAndNeverShown) {
  StandInHub stand_in;
  const Json made = hub(stand_in.url(), {{"token", "abc.def"}});
  EXPECT_EQ(made["token_set"], true);
  EXPECT_EQ(made["secret"], nullptr) << "nothing is signed";
  EXPECT_EQ(made.dump().find("abc.def"), std::string::npos);
  EXPECT_EQ(get("/api/v1/webhooks").body.find("abc.def"), std::string::npos);
  ASSERT_EQ(post(path(made) + "/test", "").status, 202);
  delivered(made);
  for (const auto& one : stand_in.seen()) EXPECT_EQ(one.token, "Bearer abc.def") << one.path;
  restart();
  EXPECT_EQ(json(get(path(made)))["token_set"], true);
}

TEST_F(OmloxPush, ALiveLocationIsSentAndItsResultShows) {
  StandInHub stand_in;
  const Json made = hub(stand_in.url());
  EXPECT_EQ(json(get(path(made)))["live"], nullptr);
  const auto id = flight();
  fly(id);
  const Json came = stand_in.location(anywhere);
  EXPECT_EQ(came["provider_id"], "0x6e01");
  EXPECT_EQ(came["crs"], "EPSG:4326");
  EXPECT_EQ(came["position"]["type"], "Point");
  EXPECT_TRUE(stand_in.kept("/providers").contains("0x6e01")) << "the hub knows the tag before its location";
  fly(id, k_lon + 0.001);
  stand_in.location([](const Json& one) { return one["position"]["coordinates"][0] > k_lon + 0.0005; });
  const auto end = std::chrono::steady_clock::now() + 20s;
  Json live;
  do {
    live = json(get(path(made)))["live"];
  } while ((live.is_null() || live["taken"] < 2) && std::chrono::steady_clock::now() < end);
  EXPECT_EQ(live["taken"], 2) << "once for each change";
  EXPECT_EQ(live["status"], 204);
  EXPECT_EQ(live["fault"], nullptr);
}

TEST_F(OmloxPush, TheOtherDialectTakesLocationsByPost) {
  StandInHub stand_in;
  hub(stand_in.url(), {{"dialect", "objects"}});
  fly(flight());
  stand_in.location(anywhere);
  EXPECT_EQ(stand_in.count("POST", "/providers/locations"), 1U);
  EXPECT_EQ(stand_in.count("PUT", "/providers/locations"), 0U);
}

TEST_F(OmloxPush, ALocationThatAHubDidNotTakeOutlivesTheProcess) {
  waits_s_ = std::vector<double>(1000, 0.05);
  restart();
  const int port = free_port();
  const Json made = hub("http://127.0.0.1:" + std::to_string(port) + "/v2");
  fly(flight());
  delivery(made, [](const Json& one) { return one["event"] == "location.updated"; });
  close();
  StandInHub stand_in(false, port);
  open();
  const Json came = stand_in.location(anywhere);
  EXPECT_EQ(came["provider_id"], "0x6e01");
  EXPECT_EQ(came["timestamp_generated"], "2026-05-04T10:11:12.345Z") << "when it was measured";
}

TEST_F(OmloxPush, GoesNowhereOnThisMachineUnlessAllowed) {
  allow_private_ = false;
  waits_s_ = {3600};
  restart();
  StandInHub stand_in;
  const Json made = hub(stand_in.url());
  ASSERT_EQ(post(path(made) + "/test", "").status, 202);
  const Json told = delivery(made, [](const Json& one) { return !one["fault"].is_null(); });
  EXPECT_NE(told["fault"].get<std::string>().find("to allow it, set webhooks.allow_private"),
            std::string::npos);
  EXPECT_TRUE(stand_in.seen().empty());
}

TEST_F(OmloxPush, RefusesWhatOnlyTheOtherKindHas) {
  const Json base{{"name", "x"}, {"url", "https://hub.example/v2"}};
  for (const Json& more :
       {Json{{"dialect", "official"}}, Json{{"token", "t"}}, Json{{"events", {"location.updated"}}},
        Json{{"kind", "omlox_hub"}, {"events", {"alarm.raised"}}},
        Json{{"kind", "omlox_hub"}, {"token", "a b"}}, Json{{"kind", "omlox_hub"}, {"dialect", "x"}},
        Json{{"kind", "carrier_pigeon"}},
        Json{{"kind", "omlox_hub"}, {"url", "https://hub.example/v2?x=1"}}}) {
    Json body = base;
    body.update(more);
    EXPECT_EQ(post("/api/v1/webhooks", body.dump()).status, 422) << more;
  }
  const Json made = hub("https://hub.example/v2");
  EXPECT_EQ(made["events"], Json::array({"revision.published", "location.updated"}));
  Call change;
  change.headers["if-match"] = "*";
  EXPECT_EQ(call(Method::patch, path(made), R"({"kind":"cloud_event"})", change).status, 422);
}

}  // namespace
}  // namespace anchord::test::omlox_push_test
