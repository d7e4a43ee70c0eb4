// What happened in a flight is read after a restart as before it, and no slow disk holds a flight up.
#include "api/admin/flight_events.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "api/kit/late_writer.hpp"
#include "core/ports/event_store.hpp"
#include "kept_fixture.hpp"

namespace anchord::test::flight_events_test {
namespace {

class FlightEventRoutes : public KeptFixture {
 protected:
  std::vector<Json> events(const std::string& id, std::map<std::string, std::string> query = {}) {
    const auto answer = get(path(id, "/events"), std::move(query));
    EXPECT_EQ(answer.status, 200) << answer.body;
    return json(answer)["items"];
  }
};

TEST_F(FlightEventRoutes, AreTheSameAfterARestart) {
  const auto id = make_id("kept");
  fly(id);
  post(path(id, "/actions"), R"({"action":"return_home","lease":")" + lease(id) + "\"}");
  const auto before = events(id);
  ASSERT_GT(before.size(), 3u);
  restart();
  // What came since, first: what the restart did to the flight.
  auto after = events(id);
  ASSERT_GE(after.size(), before.size());
  after.erase(after.begin(), after.end() - static_cast<std::ptrdiff_t>(before.size()));
  EXPECT_EQ(after, before);
}

TEST_F(FlightEventRoutes, SayWhereTheAircraftWasSent) {
  const auto id = make_id("sent");
  fly(id);
  // The pilot flies by hand: once in the air, to the first waypoint of the plan.
  fix_at(id, 20, 59.5);
  const auto all = events(id);
  const auto sent =
      std::ranges::find_if(all, [](const Json& e) { return e["code"] == "procedure.go_to_waypoint"; });
  ASSERT_NE(sent, all.end());
  ASSERT_TRUE((*sent)["place"].is_object());
  EXPECT_NEAR((*sent)["place"]["lon"], 3.7130, 1e-9);
  EXPECT_NEAR((*sent)["place"]["lat"], 51.02305, 1e-9);
  EXPECT_NEAR((*sent)["place"]["height_above_ground_m"], 4, 1e-3);
  const auto take_off =
      std::ranges::find_if(all, [](const Json& e) { return e["code"] == "procedure.take_off"; });
  ASSERT_NE(take_off, all.end());
  EXPECT_TRUE((*take_off)["place"].is_null());
}

TEST_F(FlightEventRoutes, ComeInPagesThatHaveEachOnce) {
  const auto id = make_id("pages");
  fly(id);
  const auto all = events(id);
  ASSERT_GT(all.size(), 3u);
  std::vector<Json> found;
  std::string cursor;
  do {
    std::map<std::string, std::string> query{{"limit", "2"}};
    if (!cursor.empty()) query["cursor"] = cursor;
    const Json page = json(get(path(id, "/events"), query));
    for (const auto& item : page["items"]) found.push_back(item);
    cursor = page["next_cursor"].is_null() ? "" : page["next_cursor"].get<std::string>();
  } while (!cursor.empty() && found.size() < 100);
  EXPECT_EQ(found, all);
  EXPECT_EQ(get(path(id, "/events"), {{"cursor", "x"}}).status, 422);
}

TEST_F(FlightEventRoutes, GoWithTheirMission) {
  const auto id = make_id("gone");
  finish(id);
  ASSERT_FALSE(events(id).empty());
  ASSERT_EQ(remove(id).status, 204);
  ASSERT_EQ(ask(api::Method::post, path(id, "/restore")).status, 200);
  EXPECT_FALSE(events(id).empty());
}

/// A store whose disk takes nothing while it is stuck.
class StuckStore final : public EventStore {
 public:
  Result<void> append(std::span<const LiveEvent> events) override {
    if (stuck) return make_error(Errc::storage_full, "no space left");
    auto all = events_.lock();
    for (const auto& event : events)
      if (std::ranges::find(*all, event.id, &LiveEvent::id) == all->end()) all->push_back(event);
    return boost::outcome_v2::success();
  }
  Result<std::vector<LiveEvent>> events(const MissionId& mission, std::size_t limit, std::optional<UtcTime>,
                                        const std::optional<EventId>&) override {
    std::vector<LiveEvent> out;
    {
      const auto all = events_.lock();
      out = *all;
    }
    std::erase_if(out, [&](const LiveEvent& e) { return e.mission != mission; });
    std::ranges::reverse(out);
    if (out.size() > limit) out.resize(limit);
    return out;
  }
  std::size_t stored() const {
    const auto all = events_.lock();
    return all->size();
  }
  std::atomic<bool> stuck{false};

 private:
  Locked<std::vector<LiveEvent>> events_;
};

class FlightEventsRules : public ::testing::Test {
 protected:
  LiveEvent event(const std::string& text) {
    return {EventId{make_uuid_v7(UtcTime{++t_})}, UtcTime{t_}, EventLevel::info, "x.y", text, mission_, {}};
  }
  std::vector<std::string> texts() {
    std::vector<std::string> out;
    const auto read = events_.newest(mission_, 1000);
    for (const auto& event : read.value()) out.push_back(event.text);
    return out;
  }
  std::int64_t t_{1};
  const MissionId mission_{make_uuid_v7(UtcTime{1})};
  StuckStore store_;
  api::LateWriter late_{[](std::string_view) {}};
  api::FlightEvents events_{store_, late_};
};

TEST_F(FlightEventsRules, AreReadInOrderWhileTheDiskTakesNothingAndStoredOnceWhenItDoes) {
  events_.keep(event("first"));
  ASSERT_TRUE(late_.flush(std::chrono::seconds(10)));
  store_.stuck = true;
  std::vector<std::string> expected;
  for (int i = 0; i < 250; ++i) {
    events_.keep(event(std::to_string(i)));
    expected.insert(expected.begin(), std::to_string(i));
  }
  expected.emplace_back("first");
  EXPECT_EQ(store_.stored(), 1u);
  EXPECT_EQ(texts(), expected);
  store_.stuck = false;
  ASSERT_TRUE(late_.flush(std::chrono::seconds(10)));
  EXPECT_EQ(store_.stored(), 251u);
  EXPECT_EQ(texts(), expected);
}

TEST_F(FlightEventsRules, OfNoMissionAreNotKept) {
  auto of_server = event("of the server");
  of_server.mission.reset();
  events_.keep(of_server);
  ASSERT_TRUE(late_.flush(std::chrono::seconds(10)));
  EXPECT_EQ(store_.stored(), 0u);
}

}  // namespace
}  // namespace anchord::test::flight_events_test
