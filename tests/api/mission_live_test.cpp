// A flight in the air: what restarts, joint solutions and the accuracy goal do to its running estimates.
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "api/stream/conversation.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/ports/plan_store.hpp"
#include "mission_fixture.hpp"

namespace anchord::test::mission_live_test {
namespace {

TEST_F(MissionLive, GoesOnAfterARestartWhereItWas) {
  const MadeFlight made;
  const auto flight = streamed(made);
  const auto id = mission("local");
  deliver(id, flight, 0, 80);
  const auto before = live(id);
  ASSERT_EQ(before.size(), 4U);
  restart();
  deliver(id, flight, 80, 120.5);
  const auto after = live(id);
  ASSERT_EQ(after.size(), 4U);
  for (const auto& [anchor, properties] : after) {
    const int n_before = before.at(anchor)["quality"]["n_ranges"], n = properties["quality"]["n_ranges"];
    EXPECT_GT(n, n_before) << anchor;
    EXPECT_LE(n, static_cast<int>(flight.ranges.size() / 4 + 2)) << "a row counted twice";
    const auto at = properties["local_m"].get<std::vector<double>>();
    const auto& truth = made.anchors.at(std::stoul(anchor, nullptr, 16) - 0x6000);
    EXPECT_LT((Eigen::Vector3d(at.at(0), at.at(1), at.at(2)) - truth).norm(), 0.3) << properties.dump();
  }
}

/// A page that is opened late, and a replay: every moment as it was, the end as it is.
TEST_F(MissionLive, TellsWhatWasEstimatedWhen) {
  const MadeFlight made;
  const auto flight = streamed(made);
  const auto id = mission("local");
  EXPECT_TRUE(json(get("/api/v1/missions/" + id + "/estimates"))["items"].empty());
  deliver(id, flight, 0, 120.5);
  ASSERT_EQ(post("/api/v1/missions/" + id + "/actions", R"({"action":"finish"})").status, 200);
  const auto items = json(get("/api/v1/missions/" + id + "/estimates"))["items"];
  std::map<std::string, std::vector<Json>> over_time;
  std::int64_t last_us = 0;
  for (const auto& one : items) {
    over_time[one["anchor"]].push_back(one);
    EXPECT_EQ(one["mission"], id);
    EXPECT_LE(one["t_us"].get<std::int64_t>(), k_start_us + 120'500'000);
    last_us = std::max(last_us, one["t_us"].get<std::int64_t>());
  }
  ASSERT_EQ(over_time.size(), 4U);
  EXPECT_GT(last_us, k_start_us + 110'000'000);
  for (const auto& [anchor, points] : over_time) {
    EXPECT_GE(points.size(), 20U) << anchor;
    EXPECT_LE(points.size(), 61U) << "every two seconds of two minutes";
    // It begins with few ranges and ends with all of them, and the last one is what the flight gives now.
    EXPECT_LT(3 * points.front()["n_ranges"].get<int>(), points.back()["n_ranges"].get<int>()) << anchor;
    const auto& truth = made.anchors.at(std::stoul(anchor, nullptr, 16) - 0x6000);
    const auto at = points.back()["enu_m"].get<std::vector<double>>();
    EXPECT_LT((Eigen::Vector3d(at.at(0), at.at(1), at.at(2)) - truth).norm(), 0.3) << points.back().dump();
  }
  EXPECT_EQ(get("/api/v1/missions/01a20000-0000-7000-8000-000000000000/estimates").status, 404);
}

/// Rows reach the live flight while it is still reading what was stored: none is lost, none counted twice.
TEST_F(MissionLive, TakesRowsThatComeWhileItReadsWhatWasStored) {
  const auto flight = streamed(MadeFlight{});
  const auto id = mission("local");
  deliver(id, flight, 0, 80);
  HeldExecutor later;
  live_ = &later;
  restart();
  deliver(id, flight, 80, 120.5);
  EXPECT_GT(later.held(), 0U) << "no request did the reading itself";
  while (later.run_one()) continue;
  std::size_t n = 0;
  for (const auto& [anchor, properties] : live(id)) n += properties["quality"]["n_ranges"].get<std::size_t>();
  EXPECT_LE(n, flight.ranges.size());
  EXPECT_GT(n, flight.ranges.size() * 95 / 100) << "but for those at the ends of the track";
  close();
}

/// An import is faster than the estimates: what its queue could not hold is read back, and nothing is warned
/// of twice.
TEST_F(MissionLive, HasEveryStoredRangeOnceFinishedThoughItsQueueOverflowed) {
  const auto flight = streamed(MadeFlight{});
  HeldExecutor later;
  live_ = &later;
  restart();
  const auto id = mission("local");
  while (later.run_one()) continue;
  deliver(id, flight, 0, 120.5);
  std::string others;
  for (std::size_t i = 0; i < 100'000; ++i)  // as many as wait at most
    others += R"({"tag":"0x6e01","anchor":"0x6fff","distance_m":9,"seq":)" + std::to_string(i) +
              R"(,"t_us":)" + std::to_string(k_start_us + 200'000'000 + static_cast<std::int64_t>(i)) + "}\n";
  ASSERT_EQ(post("/api/v1/ranges", others, "application/x-ndjson", {{"mission", id}}).status, 200);
  ASSERT_EQ(post("/api/v1/missions/" + id + "/actions", R"({"action":"finish"})").status, 200);
  while (later.run_one()) continue;
  std::size_t n = 0;
  for (const auto& [anchor, properties] : live(id))
    n += properties["quality"]["n_ranges"].get<std::size_t>() +
         properties["quality"]["n_refused"].get<std::size_t>();
  EXPECT_EQ(n, flight.ranges.size() + 100'000);
  const auto events = json(get("/api/v1/missions/" + id + "/events"))["items"];
  EXPECT_EQ(std::ranges::count_if(events, [](const Json& e) { return e["code"] == "live.behind"; }), 1);
  close();
}

/// Nobody looks for a fix behind the last one any more: no range is left without a word.
TEST_F(MissionLive, TellsOfEveryRangeOnceTheFlightIsFinished) {
  auto flight = streamed(MadeFlight{});
  const auto id = mission("local");
  deliver(id, flight, 0, 30);
  flight.fixes.clear();
  deliver(id, flight, 30, 31);
  const auto sent =
      std::ranges::count_if(flight.ranges, [](const Range& r) { return r.time.seconds() < 31; });
  const auto told = [&] {
    std::ptrdiff_t n = 0;
    for (const auto& [anchor, properties] : live(id)) {
      const auto& quality = properties["quality"];
      n += quality["n_ranges"].get<std::ptrdiff_t>() + quality["n_refused"].get<std::ptrdiff_t>();
    }
    return n;
  };
  EXPECT_LT(told(), sent) << "the last second waits for a fix";
  ASSERT_EQ(post("/api/v1/missions/" + id + "/actions", R"({"action":"finish"})").status, 200);
  EXPECT_EQ(told(), sent);
}

TEST_F(MissionLive, CallsAnAnchorConvergedOnlyWithinTheGoal) {
  const auto flight = streamed(MadeFlight{});
  HeldExecutor held;
  joint_ = &held;
  for (const auto& [goal, status] : {std::pair{AccuracyGoal{.h95_m = 2, .v95_m = 2}, "converged"},
                                     {{.h95_m = 1e-4, .v95_m = 2}, "estimating"}}) {
    goal_ = goal;
    restart();
    const auto id = mission("local");
    deliver(id, flight, 0, 120.5);
    for (const auto& [anchor, properties] : live(id))
      EXPECT_EQ(properties["status"], "estimating") << "no gate was asked yet: " << properties.dump();
    // The first of them may have come before the last rows.
    const auto all_are = [&](const auto& anchors) {
      return anchors.size() == 4 &&
             std::ranges::all_of(anchors, [&](const auto& one) { return one.second["status"] == status; });
    };
    bool solved = false;
    using Clock = std::chrono::steady_clock;
    for (const auto end = Clock::now() + std::chrono::minutes(1);
         Clock::now() < end && !(solved && all_are(live(id)));) {
      solved = held.run_one() || solved;
      std::this_thread::yield();
    }
    EXPECT_TRUE(solved);
    EXPECT_TRUE(all_are(live(id))) << Json(live(id)).dump();
    close();
  }
}

/// The site wants more than can be had; the plan that was flown wants no more than 5 m, of one anchor.
TEST_F(MissionLive, HoldsAnAnchorAgainstTheTargetOfItsFlownPlanAndNotAgainstTheSites) {
  const auto flight = streamed(MadeFlight{});
  HeldExecutor held;
  joint_ = &held;
  goal_ = {.h95_m = 1e-4, .v95_m = 1e-4};
  restart();
  const auto id = mission("local");
  const MissionId key{parse_uuid(id).value()};
  ASSERT_TRUE(database_->stores().plans.keep_procedure(
      key, R"({"landed":true,"targets":{"sigma_m":null,"anchors":{"0x6000":5}}})", UtcTime{}));
  restart();
  deliver(id, flight, 0, 120.5);
  const auto done = [&] {
    const auto anchors = live(id);
    return anchors.contains("0x6000") && anchors.at("0x6000")["status"] == "converged";
  };
  for (const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
       std::chrono::steady_clock::now() < end && !done();) {
    (void)held.run_one();
    std::this_thread::yield();
  }
  for (const auto& [anchor, properties] : live(id)) {
    const bool own = anchor == "0x6000";
    EXPECT_EQ(properties["status"], own ? "converged" : "estimating") << anchor;
    EXPECT_EQ(properties["goal"]["source"], own ? "anchor_target" : "site") << anchor;
    EXPECT_EQ(properties["quality"]["gates"].back()["name"], own ? "target_sigma_m" : "goal_v95_m") << anchor;
  }
  EXPECT_EQ(json(get("/api/v1/missions/" + id))["flight_time"], nullptr);
  close();
}

/// Newest estimates (or poses, under no anchor) told on the hub; waits for the next message, never longer
/// than three minutes.
class Listener {
 public:
  explicit Listener(api::Hub& hub, const std::string& topic = "anchors.estimates")
      : client_(hub, api::Principal{"t", "t", {api::Role::viewer}}) {
    client_.on_open([this] {
      const std::scoped_lock lock(mutex_);
      woken_ = true;
      changed_.notify_all();
    });
    client_.on_text(Json{{"op", "sub"}, {"id", 1}, {"topic", topic}}.dump());
  }
  ~Listener() { client_.on_close(); }
  template <class Enough>
  bool wait(Enough enough) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(3);
    while (true) {
      while (const auto frame = client_.next_frame()) {
        const Json told = Json::parse(*frame);
        if (told["op"] != "snap" && told["op"] != "data") continue;
        const Json& data = told["data"];
        const Json rows = data.is_array() ? data : Json::array({data});
        for (const auto& estimate : rows) newest[estimate.value("anchor", "")] = estimate;
      }
      if (enough(newest)) return true;
      std::unique_lock lock(mutex_);
      if (!changed_.wait_until(lock, deadline, [this] { return woken_; })) return false;
      woken_ = false;
    }
  }
  std::map<std::string, Json> newest;

 private:
  api::Conversation client_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool woken_{false};
};

/// The strand of a mission solves, or reads what was stored, for seconds: the aircraft on the map moves.
TEST_F(MissionLive, ShowsWhereTheAircraftIsThoughEstimatesWait) {
  const auto flight = streamed(MadeFlight{});
  const auto id = mission("local");
  deliver(id, flight, 0, 30);
  ASSERT_EQ(live(id).size(), 4U);
  HeldExecutor later;
  live_ = &later;
  restart();
  {
    Listener listener(app_->hub(), "drone.pose");
    const auto shown_at = [&](double t_s) {
      return listener.wait([&](const auto& newest) {
        return newest.contains("") &&
               newest.at("")["t_us"].template get<std::int64_t>() > k_start_us + std::llround(t_s * 1e6);
      });
    };
    deliver(id, flight, 30, 60);
    EXPECT_TRUE(shown_at(59)) << "while stored rows wait to be read";
    while (later.run_one()) continue;
    deliver(id, flight, 60, 90);
    EXPECT_GT(later.held(), 0U);
    EXPECT_TRUE(shown_at(89)) << "while rows wait to be solved";
    const auto last = std::ranges::find_if(
        flight.fixes, [&](const Fix& f) { return f.time.us() + k_start_us == listener.newest[""]["t_us"]; });
    ASSERT_NE(last, flight.fixes.end());
    const auto at = listener.newest[""]["enu_m"].get<std::vector<double>>();
    EXPECT_LT((Eigen::Vector3d(at.at(0), at.at(1), at.at(2)) - last->local_m).norm(), 1e-3);
    while (later.run_one()) continue;
  }
  close();
}

// A flight up and down before one wall: the mirror solution of every anchor is as far in front of it as the
// anchor is behind, and the own search of a live anchor cannot tell. The outline the site has can, through
// the joint solution in flight.
TEST_F(MissionLive, TakesTheOutlineOfTheSiteAsAPriorWhileItFlies) {
  MadeFlight facade;
  facade.frame = TrackFrame::wgs84;
  facade.width_m = 0;
  facade.anchors = {{12, 8, 1.5}, {-10, 9, 6}, {3, 12, 2}, {-6, 10, 9}};
  const EnuFrame frame(facade.origin);
  Json ring = Json::array();
  for (const auto& [e, n] : {std::pair{-30, 4}, {30, 4}, {30, 34}, {-30, 34}, {-30, 4}}) {
    const Wgs84 at = frame.wgs84_from_enu({Eigen::Vector3d(e, n, 0)});
    ring.push_back({at.lon_deg, at.lat_deg});
  }
  const auto site =
      post("/api/v1/sites",
           Json{{"name", "hall"}, {"outline", {{"type", "Polygon"}, {"coordinates", {ring}}}}}.dump());
  ASSERT_EQ(site.status, 201) << site.body;
  const auto made = post(
      "/api/v1/missions",
      Json{{"name", "facade"}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}, {"site", json(site)["id"]}}
          .dump());
  ASSERT_EQ(made.status, 201) << made.body;
  Listener listener(app_->hub());
  deliver(json(made).value("id", ""), streamed(facade), 0, 120.5);
  EXPECT_TRUE(listener.wait([](const auto& newest) {
    return newest.size() == 4 &&
           std::ranges::all_of(newest, [](const auto& one) { return one.second["verdict"] == "ok"; });
  })) << Json(listener.newest).dump();
  for (const auto& [anchor, told] : listener.newest) {
    const Eigen::Vector3d at =
        frame
            .enu_from_wgs84({told["lat"].get<double>(), told["lon"].get<double>(), told["h_m"].get<double>()})
            .m;
    const auto& truth = facade.anchors.at(std::stoul(anchor, nullptr, 16) - 0x6000);
    EXPECT_LT((at - truth).norm(), 0.5) << told.dump();
  }
}

/// They take seconds each, and every flight could keep a core busy with its own.
TEST_F(MissionLive, OneJointSolutionIsComputedAtATimeWhicheverFlightItIsOf) {
  HeldExecutor held;
  joint_ = &held;
  restart();
  const auto flight = streamed(MadeFlight{});
  const auto first = mission("local"), second = mission("local");
  deliver(first, flight, 0, 120.5);
  const auto posted = [&] {
    using Clock = std::chrono::steady_clock;
    for (const auto end = Clock::now() + std::chrono::seconds(30); Clock::now() < end;) {
      if (held.held() > 0) return true;
      std::this_thread::yield();
    }
    return false;
  };
  ASSERT_TRUE(posted());
  deliver(second, flight, 0, 120.5);
  EXPECT_EQ(held.held(), 1U);
  ASSERT_TRUE(held.run_one());
  ASSERT_TRUE(posted()) << "then it is the other's turn";
  EXPECT_EQ(held.held(), 1U);
  ASSERT_TRUE(held.run_one());
  close();
}

}  // namespace
}  // namespace anchord::test::mission_live_test
