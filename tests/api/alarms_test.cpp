// Alarms of dashboard.md section 6: when they are raised, acknowledged and over.
#include "api/admin/alarm_board.hpp"
#include "api/admin/event_log.hpp"
#include "app_fixture.hpp"
#include "core/flight/pulse.hpp"
#include "core/ports/devices.hpp"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <thread>

namespace anchord::test::alarms_test {
namespace {

using api::AlarmPriority;
using api::FlightPulse;

UtcTime at(double s) { return UtcTime::from_seconds(1e9 + s); }
/// The same by the steady clock, which knows nothing of 2001.
SteadyTime steady(double s) { return {static_cast<std::int64_t>(s * 1e9)}; }

/// A flight in which everything is well at second 100.
FlightPulse well() {
  FlightPulse f;
  f.name = "flight";
  f.now = steady(100);
  f.newest_fix = f.newest_range = at(100);
  f.fix_arrival = f.range_arrival = steady(100);
  f.fix = FixClass::rtk_fixed;
  f.as_it_happens = true;
  return f;
}
/// "id" of every alarm, joined; "" when all is well.
std::string raised(const FlightPulse& flight, const api::ServerPulse& store = {}) {
  std::string out;
  for (const auto& c : api::alarm_conditions({flight}, store)) out += (out.empty() ? "" : " ") + c.id;
  return out;
}

TEST(AlarmRules, AreQuietWhenAllIsWell) { EXPECT_EQ(raised(well()), ""); }

TEST(AlarmRules, CallRtkLostAfterTwoSecondsBelowFloat) {
  auto f = well();
  f.fix = FixClass::single;
  f.below_float_since = at(98.5);
  EXPECT_EQ(raised(f), "");
  f.below_float_since = at(97.5);
  EXPECT_EQ(raised(f), "rtk.lost");
  EXPECT_EQ(api::alarm_conditions({f}, {})[0].priority, AlarmPriority::critical);
}

TEST(AlarmRules, CallRtkLostWhenTheRoverFallsSilentWhileRangesCome) {
  auto f = well();
  f.newest_fix = at(97);
  f.fix_arrival = steady(97);
  EXPECT_EQ(raised(f), "rtk.lost");
  f.newest_fix = at(98.5);
  f.fix_arrival = steady(98.5);
  EXPECT_EQ(raised(f), "");
}

TEST(AlarmRules, CallRtkLostWhenRangesComeAndNeverAPosition) {
  auto f = well();
  f.newest_fix.reset();
  f.fix_arrival.reset();
  f.first_range = f.newest_range;
  EXPECT_EQ(raised(f), "") << "the rover may come yet";
  f.first_range->ns -= 25'000'000'000;
  EXPECT_EQ(raised(f), "rtk.lost");
}

TEST(AlarmRules, CallRtkLostWhenCorrectionsAreOld) {
  auto f = well();
  f.correction_age_s = 10.5;
  EXPECT_EQ(raised(f), "rtk.lost");
}

TEST(AlarmRules, CallFloatAfterFiveSecondsWhileRanging) {
  auto f = well();
  f.fix = FixClass::rtk_float;
  f.float_since = at(96);
  EXPECT_EQ(raised(f), "");
  f.float_since = at(94);
  EXPECT_EQ(raised(f), "rtk.float");
}

TEST(AlarmRules, CallForRangesAfterFiveSecondsWithout) {
  auto f = well();
  f.newest_range = at(94);
  f.range_arrival = steady(94);
  EXPECT_EQ(raised(f), "uwb.none");
  f.newest_range.reset();
  f.range_arrival.reset();
  EXPECT_EQ(raised(f), "") << "a flight that never ranged misses nothing";
}

TEST(AlarmRules, CallClocksThatDifferBeyondDoubt) {
  auto f = well();
  f.lag_s = -0.3;
  f.lag_sigma_s = 0.02;
  EXPECT_EQ(raised(f), "clock.skew");
  f.lag_sigma_s = 0.2;
  EXPECT_EQ(raised(f), "") << "within what the flight can tell";
}

TEST(AlarmRules, CallRangesThatAreStampedAfterTheyArrive) {
  auto f = well();
  flight::FlightWatch watch;
  const auto take = [&](double stamp_s, double received_s) {
    for (int i = 0; i < 20; ++i) watch.note_range(at(stamp_s), at(received_s));
    f.ahead_s = watch.look(at(stamp_s), {}).ahead_s;
  };
  take(99.8, 100);
  EXPECT_EQ(raised(f), "");
  take(112, 100);
  EXPECT_EQ(raised(f), "clock.skew");
  watch.note_range(at(100), at(100));
  f.ahead_s = watch.look(at(112), {}).ahead_s;
  EXPECT_EQ(raised(f), "") << "one that is right: what the others waited for is not known";
}

TEST(AlarmRules, CallATagThatTheMissionDoesNotHaveUntilItHasBeenSilentForTenSeconds) {
  auto f = well();
  flight::FlightWatch watch;
  const auto take = [&](double newest_s) {
    f.unknown_tags = watch.look(at(newest_s), flight::FlightWatch::Steady{}).unknown_tags;
  };
  take(100);
  EXPECT_EQ(raised(f), "");
  watch.note_unknown_tag(NetworkId{0x6e02}, at(101), "0x6e01");
  f.known_tags = watch.look(at(102), flight::FlightWatch::Steady{}).known_tags;
  take(102);
  EXPECT_EQ(raised(f), "uwb.tag");
  EXPECT_EQ(api::alarm_conditions({f}, {})[0].text,
            "flight: ranges of tag 0x6e02 are stored and not used, the mission has 0x6e01: correct the tags "
            "of the mission, or put its tag on the "
            "aircraft");
  take(111.5);
  EXPECT_EQ(raised(f), "");
}

TEST(AlarmRules, CallCorrectionsThatAreNotAppliedAndAnchorsThatModelsMove) {
  auto f = well();
  flight::FlightWatch watch;
  const NetworkId anchor{0x6001};
  const auto take = [&] {
    const auto now = watch.look(at(100), flight::FlightWatch::Steady{});
    f.models_withheld = now.models_withheld;
    f.models_moved = now.models_moved;
  };
  for (int i = 0; i < 9; ++i) watch.note_model("it is of another unit");
  watch.note_moved(anchor, 2.9, 0.1);
  watch.note_moved(NetworkId{0x6002}, 28, 15);
  take();
  EXPECT_EQ(raised(f), "") << "nine odd ranges, and a position that nobody knows yet";
  watch.note_model("it is of another unit");
  watch.note_moved(anchor, 28, 0.4);
  take();
  EXPECT_EQ(raised(f), "model.withheld model.moved");
  EXPECT_NE(api::alarm_conditions({f}, {})[1].text.find("0x6001"), std::string::npos);
  for (int i = 0; i < 50; ++i) watch.note_model("");
  watch.note_moved(anchor, std::nullopt, 0.4);
  take();
  EXPECT_EQ(raised(f), "");
}

TEST(AlarmRules, SayNothingOfUploads) {
  auto f = well();
  f.below_float_since = at(0);
  f.as_it_happens = false;
  EXPECT_EQ(raised(f), "");
}

// A hub that came loose takes rover and tag at once: nothing recovered, so nothing is over.
TEST(AlarmRules, StandWhileRoverAndTagAreSilentHoweverLong) {
  auto f = well();
  f.now = steady(140);
  EXPECT_EQ(raised(f), "rtk.lost uwb.none");
  EXPECT_NE(api::alarm_conditions({f}, {})[0].text.find("finish the flight if it is over"),
            std::string::npos);
  f.now = steady(7'200);
  EXPECT_EQ(raised(f), "rtk.lost uwb.none");
}

TEST(AlarmRules, CallDiskQueueAndStore) {
  EXPECT_EQ(raised(well(), {.disk_free_bytes = 1ULL << 30}), "disk.low");
  EXPECT_EQ(raised(well(), {.disk_free_bytes = 3ULL << 30}), "");
  EXPECT_EQ(raised(well(), {.queued_rows = 50'000}), "queue.behind");
  EXPECT_EQ(raised(well(), {.clock_skew = "3 s fast"}), "clock.skew");
  EXPECT_EQ(raised(well(), {.unrecorded = "no space"}), "recording.failed");
  EXPECT_EQ(raised(well(), {.writable = false, .reason = "the disk is full"}), "storage.unwritable");
  EXPECT_EQ(raised(well(), {.reason = "no write for 7 s", .stalled = true}), "storage.stalled");
}

TEST(AlarmRules, AreOfEachFlight) {
  auto north = well(), south = well();
  north.mission = MissionId{make_uuid_v7(at(1))};
  south.mission = MissionId{make_uuid_v7(at(2))};
  north.below_float_since = south.below_float_since = at(0);
  const auto conditions = api::alarm_conditions({north, south}, {});
  ASSERT_EQ(conditions.size(), 2u);
  EXPECT_EQ(conditions[0].mission, north.mission);
  EXPECT_EQ(conditions[1].mission, south.mission);
}

/// Ten looks, one a second of ours, while the flight's time passes at this speed.
bool happens(flight::FlightWatch& watch, double speed, double from_s = 0) {
  bool answer = false;
  for (int i = 0; i < 10; ++i) {
    const auto ours =
        flight::FlightWatch::Steady{} + std::chrono::milliseconds(static_cast<int>((from_s + i) * 1000));
    answer = watch.look(at((from_s + i) * speed), ours).as_it_happens;
  }
  return answer;
}

TEST(FlightWatch, KnowsAFlightAsItHappensFromUploadsAndFastReplays) {
  for (const auto& [speed, live] :
       {std::pair{1.0, true}, {0.9, true}, {5.0, false}, {60.0, false}, {0.0, false}}) {
    flight::FlightWatch watch;
    EXPECT_EQ(happens(watch, speed), live) << speed;
  }
}

TEST(FlightWatch, StaysWithWhatItWasWhenTheFlightFallsSilent) {
  flight::FlightWatch watch;
  ASSERT_TRUE(happens(watch, 1));
  bool still = false;
  for (int i = 10; i < 40; ++i)
    still = watch.look(at(9), flight::FlightWatch::Steady{} + std::chrono::seconds(i)).as_it_happens;
  EXPECT_TRUE(still);
}

TEST(FlightWatch, RemembersSinceWhenTheFixIsPoor) {
  flight::FlightWatch watch;
  const auto fix = [&](double t_s, FixClass cls) {
    Fix f;
    f.time = at(t_s);
    f.fix = cls;
    watch.note(f);
  };
  fix(1, FixClass::rtk_fixed);
  fix(2, FixClass::single);
  fix(4, FixClass::none);
  fix(3, FixClass::rtk_fixed);  // late: told nothing new
  EXPECT_EQ(watch.look(at(4), {}).below_float_since, at(2));
  fix(5, FixClass::rtk_float);
  EXPECT_FALSE(watch.look(at(5), {}).below_float_since);
  EXPECT_EQ(watch.look(at(5), {}).float_since, at(5));
}

class Alarms : public AppFixture {
 protected:
  Alarms() : hub_(clock_, "anchord test"), events_(hub_, clock_), board_(events_) {}
  std::string codes() const {
    std::string out;
    for (const auto& event : events_.newest(10, {}, {})) out = event.code + (out.empty() ? "" : " ") + out;
    return out;
  }
  api::Hub hub_;
  api::EventLog events_;
  api::AlarmBoard board_;
};

TEST_F(Alarms, StandUntilTheirConditionEndsAndAreEventsOnce) {
  const api::AlarmCondition low{"disk.low", AlarmPriority::warning, "little is free", {}};
  const api::AlarmCondition lost{"rtk.lost", AlarmPriority::critical, "lost", {}};
  board_.update({low}, at(1));
  board_.update({low, lost}, at(2));
  ASSERT_EQ(board_.standing().size(), 2u);
  EXPECT_EQ(board_.standing()[0].condition.id, "rtk.lost") << "critical first";
  EXPECT_EQ(board_.standing()[1].since, at(1));
  board_.update({}, at(3));
  EXPECT_TRUE(board_.standing().empty());
  EXPECT_EQ(codes(), "alarm.raised alarm.raised alarm.cleared alarm.cleared");
}

TEST_F(Alarms, AreQuietOnceAcknowledgedUntilTheyGetWorse) {
  api::AlarmCondition low{"disk.low", AlarmPriority::warning, "less than 2 GiB", {}};
  board_.update({low}, at(1));
  EXPECT_EQ(board_.acknowledge("disk.high", {}, "me").error().code, Errc::not_found);
  ASSERT_TRUE(board_.acknowledge("disk.low", {}, "me"));
  ASSERT_TRUE(board_.acknowledge("disk.low", {}, "me"));
  board_.update({low}, at(2));
  EXPECT_TRUE(board_.standing()[0].acknowledged);
  low.text = "less than 500 MiB";
  board_.update({low}, at(3));
  EXPECT_FALSE(board_.standing()[0].acknowledged);
  EXPECT_EQ(codes(), "alarm.raised alarm.acknowledged");
}

TEST_F(Alarms, OfTwoFlightsAreRaisedAcknowledgedAndClearedEachForItself) {
  const MissionId north{make_uuid_v7(at(1))}, south{make_uuid_v7(at(2))};
  const auto lost = [](const MissionId& of) {
    return api::AlarmCondition{"rtk.lost", AlarmPriority::critical, "lost", of};
  };
  board_.update({lost(north), lost(south)}, at(1));
  ASSERT_TRUE(board_.acknowledge("rtk.lost", north, "me"));
  board_.update({lost(north), lost(south)}, at(2));
  ASSERT_EQ(board_.standing().size(), 2u);
  for (const auto& alarm : board_.standing()) EXPECT_EQ(alarm.acknowledged, alarm.condition.mission == north);
  board_.update({lost(north)}, at(3));
  EXPECT_EQ(codes(), "alarm.raised alarm.raised alarm.acknowledged alarm.cleared");
}

/// Devices of which only the clock matters here.
class ClockOnly final : public NoDevices {
 public:
  void set(const std::string& skew) {
    const std::scoped_lock lock(mutex_);
    skew_ = skew;
  }
  /// What the next questions throw; empty: nothing.
  void throws(const std::string& what) {
    const std::scoped_lock lock(mutex_);
    throws_ = what;
  }
  DeviceClock clock() override {
    const std::scoped_lock lock(mutex_);
    if (!throws_.empty()) throw std::runtime_error(throws_);
    return {true, 0.0, 0.02, skew_};
  }

 private:
  std::mutex mutex_;
  std::string skew_, throws_;
};

class ClockAlarm : public AppFixture {
 protected:
  DeviceControl& devices() override { return devices_; }
  /// The list of alarms once it holds what is asked for; the last one when 20 s pass first.
  Json alarms_when(bool there_is, const std::string& id = "clock.skew") {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    for (;;) {
      Json items = json(get("/api/v1/alarms"))["items"];
      const bool there = std::any_of(items.begin(), items.end(),
                                     [&](const Json& alarm) { return alarm.value("id", "") == id; });
      if (there == there_is || std::chrono::steady_clock::now() > end) return items;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  ClockOnly devices_;
};

TEST_F(ClockAlarm, StandsFromTheDriftOfADeviceUntilItIsGood) {
  EXPECT_TRUE(json(get("/api/v1/alarms"))["items"].empty());
  devices_.set("the clock of device \"tag\" drifts by more than 200 ppm");
  const auto raised = alarms_when(true);
  ASSERT_EQ(raised.size(), 1u);
  EXPECT_EQ(raised[0].value("id", ""), "clock.skew");
  EXPECT_NE(raised[0].dump().find("drifts by more than 200 ppm"), std::string::npos) << raised[0];
  devices_.set("");
  EXPECT_TRUE(alarms_when(false).empty());
}

// A caster's answer in Latin-1 once threw in the heartbeat and ended the server.
TEST_F(ClockAlarm, ATaskThatThrowsIsAnAlarmAndTheHeartbeatGoesOn) {
  devices_.throws("bytes \xff\xfe");
  const auto raised = alarms_when(true, "server.task_failed");
  ASSERT_EQ(raised.size(), 1u);
  EXPECT_EQ(raised[0].value("priority", ""), "warning");
  const auto text = raised[0].value("text", "");
  EXPECT_NE(text.find("device clocks (bytes \xef\xbf\xbd\xef\xbf\xbd)"), std::string::npos) << text;
  devices_.throws("");
  devices_.set("the clock of device \"tag\" drifts by more than 200 ppm");
  EXPECT_EQ(alarms_when(true).size(), 2u);  // it beats on: what comes after is seen
}

TEST(AlarmRules, NameTheDevicesThatAreKeptAndDoNotRun) {
  api::ServerPulse server;
  server.not_started = "not started: device \"caster\" (kind: no driver for \"x\")";
  server.failed_tasks = "heartbeat (out of memory)";
  EXPECT_EQ(raised(well(), server), "server.task_failed device.not_started");
}

TEST(AlarmRules, SayWhyTheLastBackupFailed) {
  const auto found = api::alarm_conditions({}, {.not_backed_up = "the disk of /backups is full"});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].id, "backup.failed");
  EXPECT_EQ(found[0].priority, api::AlarmPriority::warning);
  EXPECT_NE(found[0].text.find("the disk of /backups is full"), std::string::npos) << found[0].text;
}

TEST_F(Alarms, AreServedAndAcknowledgedByOperatorsOnly) {
  EXPECT_TRUE(json(get("/api/v1/alarms"))["items"].empty());
  EXPECT_EQ(post("/api/v1/alarms/rtk.lost/ack", "").status, 404);
  EXPECT_EQ(post("/api/v1/alarms/rtk.lost/ack", R"({"nte":"x"})").status, 422);
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(api::Method::post, "/api/v1/alarms/rtk.lost/ack", "", viewer).status, 403);
  EXPECT_EQ(call(api::Method::get, "/api/v1/alarms", "", viewer).status, 200);
}

}  // namespace
}  // namespace anchord::test::alarms_test
