// A flight is never lost: what may be deleted, whose the devices are, what a stepped clock changes, and what
// an Idempotency-Key keeps on the disk.
#include <gmock/gmock.h>

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <thread>

#include "api/admin/access.hpp"
#include "api/admin/clock_watch.hpp"
#include "api/kit/contract.hpp"
#include "core/ports/access_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/request_mark.hpp"
#include "core/ports/token_store.hpp"
#include "kept_fixture.hpp"

namespace anchord::test::flight_kept_test {
namespace {

using api::Method;
using api::Role;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

class MissionBinRules : public KeptFixture {};

TEST_F(MissionBinRules, AMissionThatRecordsCannotBeDeleted) {
  const auto id = make_id("records");
  const auto refused = remove(id);
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("finish it first"));
  EXPECT_EQ(get(path(id)).status, 200);
}

TEST_F(MissionBinRules, AMissionInTheAirIsNeitherDeletedNorFinishedWithoutItsLease) {
  const auto id = make_id("flies");
  const auto key = fly(id);
  const auto refused = remove(id);
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("in the air"));
  const auto cut = post(path(id, "/actions"), R"({"action":"finish"})");
  EXPECT_EQ(cut.status, 409);
  EXPECT_THAT(cut.body, HasSubstr("no-control"));
  EXPECT_EQ(post(path(id, "/actions"), R"({"action":"hold","lease":")" + key + "\"}").status, 202)
      << "it can still be commanded";
  const auto plan = ask(Method::del, "/api/v1/plans/" + plan_, "", {Role::op}, {{"if-match", "\"p-1\""}});
  EXPECT_EQ(plan.status, 409) << plan.body;
  finish(id, key);
}

TEST_F(MissionBinRules, DeletingNeedsTheStateThatWasReadAndControlOrAdmin) {
  const auto id = finished("done");
  EXPECT_EQ(ask(Method::del, path(id)).status, 428);
  EXPECT_EQ(remove(id, {Role::admin}, {{"if-match", "\"m-1\""}}).status, 412);
  const auto seen = etag(id);
  ranges(id, 1);
  EXPECT_EQ(remove(id, {Role::admin}, {{"if-match", seen}}).status, 412) << "a range came meanwhile";
  const auto refused = remove(id, {Role::op});
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("Anchord-Lease"));
  EXPECT_EQ(remove(id, {Role::engineer}).status, 403);
  const auto key = lease(id, {Role::op});
  EXPECT_EQ(remove(id, {Role::op}, {{"anchord-lease", key}}).status, 204);
}

TEST_F(MissionBinRules, WhatIsInTheBinIsGoneForEverythingElseAndComesBackWhole) {
  const auto id = finished("kept");
  ranges(id, 3);
  ASSERT_EQ(remove(id).status, 204);
  for (const char* more :
       {"", "/events", "/track", "/control", "/checklist", "/procedure", "/uploads", "/grid"}) {
    const auto answer = get(path(id, more));
    EXPECT_EQ(answer.status, 410) << more << answer.body;
    EXPECT_THAT(answer.body, HasSubstr("restore")) << more;
  }
  EXPECT_EQ(remove(id, {Role::admin}, {{"if-match", "*"}}).status, 410);
  EXPECT_EQ(post(path(id, "/actions"), R"({"action":"finish"})").status, 410);
  EXPECT_TRUE(json(get("/api/v1/missions"))["items"].empty());
  EXPECT_TRUE(json(get("/api/v1/ranges"))["items"].empty());
  const auto row =
      post("/api/v1/ranges", R"({"t_us":1777889473000000,"tag":"0x6e01","anchor":"0x6a2f","distance_m":7.4})",
           "application/x-ndjson", {{"mission", id}});
  EXPECT_NE(row.status, 200) << row.body;
  EXPECT_EQ(post("/api/v1/calibrations", R"({"missions":[")" + id + "\"]}").status, 422);
  const Json bin = json(get("/api/v1/missions", {{"deleted", "true"}}))["items"];
  ASSERT_EQ(bin.size(), 1u);
  EXPECT_EQ(bin[0]["id"], id);
  EXPECT_EQ(bin[0]["n_ranges"], 3);
  EXPECT_EQ(bin[0]["deleted_by"], "tester");
  EXPECT_EQ(bin[0]["kept_for_s"], 30 * 86'400);
  EXPECT_EQ(ask(Method::post, path(id, "/restore"), "", {Role::engineer}).status, 403);
  const auto back = ask(Method::post, path(id, "/restore"), "", {Role::op});
  ASSERT_EQ(back.status, 200) << back.body;
  EXPECT_EQ(json(back)["n_ranges"], 3);
  EXPECT_EQ(header(back, "ETag"), etag(id));
  EXPECT_EQ(ask(Method::post, path(id, "/restore")).status, 409) << "it is not in the bin any more";
  EXPECT_EQ(ask(Method::post, path("0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f", "/restore")).status, 404);
  EXPECT_THAT(codes(id), Contains("mission.restored"));
}

TEST_F(MissionBinRules, TheBinIsEmptiedByRunningTimeAndNoClockStep) {
  const auto id = finished("old");
  ranges(id, 50);
  ASSERT_EQ(remove(id).status, 204);
  clock_.ahead_s = 300.0 * 86'400;
  app_->housekeeping_round();
  EXPECT_EQ(json(get("/api/v1/missions", {{"deleted", "true"}}))["items"].size(), 1u) << "a step of 300 days";
  now_s_ = now_s_ + 20.0 * 86'400;
  app_->housekeeping_round();
  restart();
  now_s_ = now_s_ + 9.9 * 86'400;  // the days before the restart count
  app_->housekeeping_round();
  ASSERT_EQ(json(get("/api/v1/missions", {{"deleted", "true"}}))["items"].size(), 1u);
  EXPECT_LT(json(get("/api/v1/missions", {{"deleted", "true"}}))["items"][0]["kept_for_s"], 86'400);
  now_s_ = now_s_ + 0.2 * 86'400;
  app_->housekeeping_round();
  EXPECT_TRUE(json(get("/api/v1/missions", {{"deleted", "true"}}))["items"].empty());
  EXPECT_EQ(get(path(id)).status, 404) << "nothing is left of it";
}

TEST_F(MissionBinRules, OnlyAdminsEmptyItEarlyAndOnlyWhatIsInIt) {
  const auto id = finished("purged");
  const auto purge = [&](std::vector<Role> roles, const std::string& match) {
    return ask(Method::del, path(id), "", std::move(roles), {{"if-match", match}}, {{"purge", "true"}});
  };
  EXPECT_EQ(purge({Role::admin}, "*").status, 409) << "not deleted yet";
  ASSERT_EQ(remove(id).status, 204);
  EXPECT_EQ(purge({Role::op}, "*").status, 403);
  EXPECT_EQ(purge({Role::admin}, "\"b-7\"").status, 412);
  const auto match = header(get(path(id), {{"deleted", "true"}}), "ETag");
  EXPECT_EQ(purge({Role::admin}, match).status, 204);
  EXPECT_EQ(ask(Method::post, path(id, "/restore")).status, 409) << "too late";
  app_->housekeeping_round();
  EXPECT_EQ(get(path(id)).status, 404);
}

/// What a stream of ingest waits for each of its batches while something else goes on.
struct Waits {
  std::vector<double> ms;
  double part(double p) {
    std::ranges::sort(ms);
    return ms.empty() ? 0 : ms[static_cast<std::size_t>(p * static_cast<double>(ms.size() - 1))];
  }
};

// 2.35 s for everybody at 1e6 rows when it was one DELETE. ANCHORD_BIN_ROWS=1000000 measures that, too.
TEST_F(MissionBinRules, ABigDeleteStallsNoIngest) {
  const char* asked = std::getenv("ANCHORD_BIN_ROWS");
  const std::size_t rows = asked != nullptr ? std::stoul(asked) : 60'000;
  const auto fill = [&](const std::string& name) {
    const auto id = finished(name);
    for (std::size_t i = 0; i < rows;) {
      std::vector<Range> batch;
      for (; batch.size() < 10'000 && i < rows; ++i) {
        Range row;
        row.mission = MissionId{parse_uuid(id).value()};
        row.time = UtcTime::from_us(1'777'889'472'000'000 + static_cast<std::int64_t>(i));
        row.tag = NetworkId{0x6e01};
        row.anchor = NetworkId{0x6a2f};
        row.distance_m = 7.4;
        batch.push_back(row);
      }
      EXPECT_TRUE(database_->stores().measurements.append_ranges(std::move(batch), false));
    }
    EXPECT_EQ(remove(id).status, 204);
    EXPECT_TRUE(database_->stores().bin.empty(MissionId{parse_uuid(id).value()}));
    return id;
  };
  const MissionId live{parse_uuid(make_id("live")).value()};
  std::int64_t at = 0;
  const auto ingest_while = [&](const std::function<void()>& work) {
    Waits waits;
    std::atomic<bool> done{false};
    std::thread worker([&] {
      work();
      done = true;
    });
    while (!done) {
      std::vector<Range> batch(50);
      for (auto& row : batch) {
        row.mission = live;
        row.time = UtcTime::from_us(1'888'000'000'000'000 + ++at);
        row.anchor = NetworkId{1};
        row.distance_m = 5;
      }
      const auto begun = std::chrono::steady_clock::now();
      EXPECT_TRUE(database_->stores().measurements.append_ranges(std::move(batch), false));
      waits.ms.push_back(
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begun).count());
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    worker.join();
    return waits;
  };
  const auto report = [&](const char* how, Waits waits) {
    std::printf(
        "    %zu rows %s: ingest of 50 rows waits p50 %.1f, p99 %.1f, at most %.0f ms (%zu batches)\n", rows,
        how, waits.part(0.5), waits.part(0.99), waits.part(1), waits.ms.size());
  };
  if (asked != nullptr) {
    fill("in one go");
    report("in one transaction",
           ingest_while([&] { (void)database_->stores().bin.remove_rows(2 * rows + 10).has_value(); }));
  }
  const auto id = fill("in slices");
  auto waits = ingest_while([&] { app_->housekeeping_round(); });
  report("in slices", waits);
  EXPECT_LT(waits.part(0.99), 250) << "the promise of ingest (docs/durability.md)";
  EXPECT_EQ(get(path(id)).status, 404);
}

class DevicesFollow : public KeptFixture {
 protected:
  std::string into() {
    const auto id = devices_.recording_into();
    return id ? to_string(*id) : "";
  }
};

TEST_F(DevicesFollow, TheFlightThatRecordsAndNoOtherByBeingMade) {
  const auto first = make("first");
  EXPECT_EQ(first["devices"]["recording"], true);
  const auto second = make("second");
  EXPECT_EQ(into(), first["id"]) << "taken in silence";
  EXPECT_EQ(second["devices"]["recording"], false);
  EXPECT_EQ(second["devices"]["held_by"]["mission"], first["id"]);
  EXPECT_THAT(codes(second["id"]), Contains("devices.held"));
  finish(second["id"]);
  EXPECT_EQ(into(), first["id"]);
  finish(first["id"]);
  EXPECT_EQ(into(), "");
  EXPECT_EQ(make("next")["devices"]["recording"], true) << "finish, then a new one: without a gap";
}

TEST_F(DevicesFollow, AreTakenWithTheLeaseAloneAndGoBack) {
  const std::string first = make_id("first");
  const auto take = [&](const std::string& key) {
    return post(
        "/api/v1/missions",
        R"({"name":"second","frame":"wgs84","track_point":"tag_antenna","take_devices":true,"lease":")" +
            key + "\"}");
  };
  const auto refused = take("");
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("no-control"));
  EXPECT_EQ(json(get("/api/v1/missions"))["items"].size(), 1u) << "nothing was made";
  const auto taken = take(lease(first));
  ASSERT_EQ(taken.status, 201) << taken.body;
  const std::string second = json(taken)["id"];
  EXPECT_EQ(into(), second);
  EXPECT_EQ(json(get(path(first)))["devices"]["held_by"]["mission"], second);
  EXPECT_THAT(codes(first), Contains("devices.lost"));
  EXPECT_THAT(codes(second), Contains("devices.taken"));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::string alarms;
  while (alarms.find("devices.lost") == std::string::npos && std::chrono::steady_clock::now() < end)
    alarms = get("/api/v1/alarms").body;
  EXPECT_THAT(alarms, HasSubstr("devices.lost"));
  EXPECT_THAT(alarms, HasSubstr("devices.taken"));
  finish(second);
  EXPECT_EQ(into(), first) << "back to whom they were taken from";
  EXPECT_THAT(codes(first), Contains("devices.returned"));
}

TEST_F(DevicesFollow, ARestartAndTheFlightGoesOnWithThemWhateverWasMadeSince) {
  const auto first = make_id("first");
  make_id("second");
  devices_.record_into({});
  clock_.ahead_s = 300.0 * 86'400;
  restart();
  EXPECT_EQ(into(), first);
}

TEST_F(DevicesFollow, AFreeStreamIsTakenByAnActionOfAMissionThatRecords) {
  const auto first = make_id("first"), second = make_id("second");
  const auto take = [&](const std::string& id) {
    return post(path(id, "/actions"), R"({"action":"take_devices"})");
  };
  EXPECT_EQ(take(second).status, 409);
  finish(first);
  EXPECT_EQ(take(first).status, 422) << "it does not record";
  EXPECT_EQ(take(second).status, 200);
  EXPECT_EQ(into(), second);
}

TEST_F(DevicesFollow, AndAreNotRemovedWhileAMissionRecordsWithThem) {
  const auto id = make_id("records");
  const std::string device = "/api/v1/devices/" + to_string(Uuid{{1}});
  const auto refused = ask(Method::del, device, "", {Role::op}, {{"if-match", "*"}});
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("in use"));
  EXPECT_FALSE(devices_.removed);
  finish(id);
  EXPECT_EQ(ask(Method::del, device, "", {Role::op}, {{"if-match", "*"}}).status, 204);
}

class ClockSteps : public KeptFixture {};

TEST_F(ClockSteps, EndNoLeaseAndProlongNone) {
  const auto id = make_id("led");
  const auto key = lease(id);
  const auto renew = [&] {
    return post(path(id, "/control"), R"({"action":"renew","lease":")" + key + "\"}");
  };
  clock_.ahead_s = 300.0 * 86'400;
  EXPECT_EQ(renew().status, 200);
  clock_.ahead_s = -300.0 * 86'400;
  EXPECT_EQ(renew().status, 200);
  now_s_ = now_s_ + 59;
  EXPECT_EQ(json(get(path(id, "/control")))["held"], true);
  now_s_ = now_s_ + 2;
  EXPECT_EQ(json(get(path(id, "/control")))["held"], false) << "a minute is a minute";
}

TEST_F(ClockSteps, LockNobodyOutAndBringNobodyBack) {
  api::AccessOptions options;
  options.steady = &steady_;
  api::AccessService access(database_->stores(), clock_, options);
  const api::Principal admin{"a", "a", {Role::admin}};
  const auto made =
      access.create_token("t", {"operator"}, UtcTime{clock_.now().ns + 3'600'000'000'000}, admin, "here");
  ASSERT_TRUE(made) << made.error().message;
  const auto cookie = access.open_session(made.value().text, "here");
  ASSERT_TRUE(cookie);
  const auto who = access.verify(made.value().text);
  ASSERT_TRUE(who);
  const auto ticket = access.make_ticket(access.login_of(*who, ""));
  clock_.ahead_s = 300.0 * 86'400;
  EXPECT_TRUE(access.verify(made.value().text));
  EXPECT_TRUE(access.session(cookie.value()));
  EXPECT_TRUE(access.take_ticket(ticket));
  EXPECT_TRUE(access.load()) << "what is known keeps its end";
  EXPECT_TRUE(access.verify(made.value().text));
  const auto late = access.make_ticket(access.login_of(*who, ""));
  clock_.ahead_s = -300.0 * 86'400;
  now_s_ = now_s_ + 31;
  EXPECT_FALSE(access.take_ticket(late));
  now_s_ = now_s_ + 3'600;
  EXPECT_FALSE(access.verify(made.value().text)) << "its hour has passed, whatever the clock says";
  EXPECT_FALSE(access.session(cookie.value())) << "and the login with it";
  clock_.ahead_s = 0;
  api::AccessService next_start(database_->stores(), clock_, options);
  ASSERT_TRUE(next_start.load());
  EXPECT_TRUE(next_start.verify(made.value().text)) << "a start judges by the clock it finds";
}

TEST_F(ClockSteps, AreAnAlarm) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::string alarms;
  while (alarms.find("clock.step") == std::string::npos && std::chrono::steady_clock::now() < end) {
    clock_.ahead_s = clock_.ahead_s + 300.0 * 86'400;  // the heart looks once a second
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    alarms = get("/api/v1/alarms").body;
  }
  EXPECT_THAT(alarms, HasSubstr("clock.step"));
  EXPECT_THAT(alarms, HasSubstr("leases"));
}

TEST(ClockWatch, SeesStepsOfTwoSecondsAndNoSlewNorAMachineThatSlept) {
  api::ClockWatch watch;
  const auto look = [&](double wall_s, double steady_s) {
    return watch.look(UtcTime::from_seconds(1e9 + wall_s), {static_cast<std::int64_t>(steady_s * 1e9)});
  };
  EXPECT_EQ(look(0, 0), "");
  EXPECT_EQ(look(1.0005, 1), "") << "slewed by NTP";
  EXPECT_EQ(look(3601, 3601), "") << "a lid was closed for an hour: both went on";
  EXPECT_EQ(look(3603.9, 3602), "");
  EXPECT_THAT(look(3606.9, 3603), HasSubstr("+2.0 s"));
  EXPECT_NE(look(3607.9, 3604), "") << "it stands";
  EXPECT_EQ(look(4300, 4300 - 3.9), "") << "for ten minutes";
  EXPECT_THAT(look(4300 - 7200, 4297), HasSubstr("-7200.9 s"));
}

class KeptAnswers : public KeptFixture {
 protected:
  api::Response keyed(const std::string& target, const std::string& body, const std::string& key,
                      std::vector<Role> roles = {Role::admin}) {
    return ask(Method::post, target, body, std::move(roles), {{"idempotency-key", key}});
  }
  std::uintmax_t folder_bytes() const {
    std::uintmax_t sum = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(dir_))
      if (entry.is_regular_file()) sum += entry.file_size();
    return sum;
  }
};

// 76 MiB in ten seconds, by somebody who may only look.
TEST_F(KeptAnswers, AViewerWhoPostsForSecondsLeavesTheDiskAsItWas) {
  const std::string plan = json(post("/api/v1/plans", R"({"name":"Hall","building_height_m":8,
      "origin":{"lon":3.7131,"lat":51.0231,"h_m":55.5},
      "outline":{"type":"Polygon","coordinates":[[[3.7131,51.0231],[3.7135275,51.0231],[3.7135275,51.0232799],[3.7131,51.0232799]]]},
      "settings":{"keep_out_m":4,"max_height_m":20},
      "waypoints":[{"lon":3.7130,"lat":51.02305,"height_above_ground_m":4}]})"))["id"];
  Json points = Json::array();
  for (int i = 0; i < 2000; ++i) points.push_back({3.71 + i * 1e-6, 51.02, 50.0});
  const std::string transform = Json{{"from", "geo"},
                                     {"to", "enu"},
                                     {"points", points},
                                     {"origin", {{"lon", 3.71}, {"lat", 51.02}, {"h_m", 50.0}}}}
                                    .dump();
  // What was written before is on its way from the WAL into the file for a moment.
  auto before = folder_bytes();
  for (const auto last = std::chrono::steady_clock::now() + std::chrono::seconds(20);
       std::chrono::steady_clock::now() < last;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1200));
    if (std::exchange(before, folder_bytes()) == before) break;
  }
  int n = 0;
  for (; n < 60; ++n) {  // 10 MiB of answers
    const auto key = std::to_string(n);
    EXPECT_EQ(keyed("/api/v1/plans/" + plan + "/validate", "", key, {Role::viewer}).status, 200);
    const auto moved = keyed("/api/v1/transform", transform, key, {Role::viewer});
    EXPECT_LT(moved.status, 500) << moved.body;
    keyed("/api/v1/models/active/predict", R"({"sample":{}})", key, {Role::viewer});
  }
  EXPECT_EQ(folder_bytes(), before) << n << " rounds";
  EXPECT_EQ(database_->stores().access.answer_use("tester").value().count, 0u);
}

TEST_F(KeptAnswers, NoRouteThatAViewerMayPostToKeepsAnythingAndTheContractSaysWhichDo) {
  const Json paths = Json::parse(api::openapi_json())["paths"];
  for (const auto& route : app_->router().routes()) {
    if (route.method != Method::post) continue;
    const api::Principal viewer{"v", "v", {Role::viewer}};
    if (route.access.permits(viewer)) {
      EXPECT_EQ(route.keeps, api::Keeps::nothing) << route.pattern;
    }
    const auto at = paths.find(route.pattern);
    ASSERT_NE(at, paths.end()) << route.pattern;
    const bool promised = (*at)["post"].dump().find("parameters/IdempotencyKey") != std::string::npos;
    EXPECT_EQ(route.keeps != api::Keeps::nothing, promised) << route.pattern;
  }
}

TEST_F(KeptAnswers, WhatWasRefusedOrOnlyTriedIsNotKept) {
  EXPECT_EQ(keyed("/api/v1/missions", R"({"name":"x"})", "k").status, 422);
  const auto again = keyed("/api/v1/missions", R"({"name":"x","frame":"local","track_point":"body"})", "k");
  EXPECT_EQ(again.status, 201) << "the corrected request, under the same key";
  EXPECT_EQ(database_->stores().access.answer_use("tester").value().count, 1u);
}

/// As a server leaves it that ends behind the commit of what was asked for, and before it has kept its
/// answer.
TEST_F(KeptAnswers, WhatWasDoneIsNotDoneAgainWhereTheServerEndedBeforeItAnswered) {
  const std::string body = R"({"name":"x","frame":"local","track_point":"body"})";
  ASSERT_EQ(keyed("/api/v1/missions", body, "k").status, 201);
  ASSERT_TRUE(database_->stores().access.drop_oldest_answers("tester", 10));
  StoredAnswer begun;
  begun.principal = "tester", begun.key = "k";
  {
    const RequestMark mark(begun);
    ASSERT_EQ(post("/api/v1/sites", R"({"name":"y","origin":{"lon":3.7,"lat":51,"h_m":50}})").status, 201);
  }
  const auto again = keyed("/api/v1/missions", body, "k");
  EXPECT_EQ(again.status, 409);
  EXPECT_THAT(again.body, HasSubstr("read what is there"));
  EXPECT_EQ(json(get("/api/v1/missions"))["items"].size(), 1u);
  EXPECT_EQ(keyed("/api/v1/missions", body, "another").status, 201);
}

TEST_F(KeptAnswers, ATokenHasAQuotaThatNeverStandsInTheWayOfACommand) {
  StoredAnswer full;
  full.principal = "tester";
  full.request_sha256_hex = "x";
  for (std::size_t i = 0; i < api::Idempotency::k_max_answers; ++i) {
    full.key = "old-" + std::to_string(i);
    full.created_ran_ns = static_cast<std::int64_t>(i);
    ASSERT_TRUE(database_->stores().access.keep_answer(full, 0));
  }
  const auto refused =
      keyed("/api/v1/missions", R"({"name":"x","frame":"local","track_point":"body"})", "new");
  EXPECT_EQ(refused.status, 429);
  EXPECT_THAT(refused.body, HasSubstr("2000"));
  EXPECT_THAT(refused.body, HasSubstr("without Idempotency-Key"));
  EXPECT_EQ(header(refused, "Retry-After"), "3600");
  EXPECT_TRUE(json(get("/api/v1/missions"))["items"].empty()) << "before anything was done";
  const auto id = make_id("commanded");
  const auto done = keyed(path(id, "/actions"), R"({"action":"finish"})", "finish");
  EXPECT_EQ(done.status, 200) << done.body;
  EXPECT_EQ(header(keyed(path(id, "/actions"), R"({"action":"finish"})", "finish"), "Idempotent-Replayed"),
            "true");
}

TEST_F(KeptAnswers, GoAfterADayOfRunningAndNotWithTheClock) {
  const std::string body = R"({"name":"x","frame":"local","track_point":"body"})";
  const auto first = keyed("/api/v1/missions", body, "k");
  clock_.ahead_s = 300.0 * 86'400;
  app_->housekeeping_round();
  EXPECT_EQ(keyed("/api/v1/missions", body, "k").body, first.body);
  now_s_ = now_s_ + 86'401;
  EXPECT_NE(keyed("/api/v1/missions", body, "k").body, first.body) << "a new one takes its place";
  now_s_ = now_s_ + 86'401;
  app_->housekeeping_round();
  EXPECT_EQ(database_->stores().access.answer_use("tester").value().count, 0u);
}

}  // namespace
}  // namespace anchord::test::flight_kept_test
