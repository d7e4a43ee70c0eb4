// What the live stream shows to tokens that are bound to sites, topic by topic.
#include "api/admin/alarm_board.hpp"
#include "api/admin/event_log.hpp"
#include "api/stream/ws_handler.hpp"
#include "site_tokens_fixture.hpp"

namespace anchord::test::site_tokens_stream_test {
namespace {

class SiteTokenStream : public SiteTokens {
 protected:
  std::unique_ptr<api::WsHandler> listen(const api::Principal& who) {
    auto client = app_->ws_factory()(who, [] { return true; });
    client->on_open([] {});
    int id = 0;
    for (const auto& topic : api::topics())
      client->on_text(Json{{"op", "sub"}, {"id", ++id}, {"topic", topic.name}}.dump());
    return client;
  }
  /// Every frame until nothing has come for a moment that is longer than the time between two of a stream.
  static std::string frames(api::WsHandler& client) {
    std::string all;
    for (int quiet = 0; quiet < 6; ++quiet) {
      while (const auto frame = client.next_frame()) {
        all += *frame + '\n';
        quiet = 0;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return all;
  }
};

TEST_P(SiteTokenStream, ShowsOnEveryTopicWhatIsOfItsSitesAlone) {
  for (auto* firm : {&alpha_, &bravo_})  // what the fixture did is in the snapshots
    fly(*firm, firm->id("mission"), 5);
  auto alpha = listen(alpha_.who), bravo = listen(bravo_.who), all = listen(api::local_principal());
  fly(alpha_, alpha_.id("mission"), 9);
  for (const auto& topic : api::topics()) {
    // As if each feature had something to say of the flight, whatever the flight is like.
    app_->hub().publish(topic.topic, R"({"name":"alpha )" + std::string(topic.name) + "\"}", 1, "key", {},
                        MissionId{parse_uuid(alpha_.id("mission")).value()});
    app_->hub().publish(topic.topic, R"({"name":"server )" + std::string(topic.name) + "\"}", 1, "other");
  }
  const auto of_alpha = frames(*alpha), of_bravo = frames(*bravo), of_all = frames(*all);
  EXPECT_EQ(betrayed(alpha_, of_bravo), "") << of_bravo;
  EXPECT_EQ(betrayed(bravo_, of_alpha), "") << of_alpha;
  for (const auto& topic : api::topics()) {
    const std::string name(topic.name);
    EXPECT_NE(of_alpha.find("alpha " + name), std::string::npos) << name;
    EXPECT_EQ(of_alpha.find("server " + name), std::string::npos) << name;
    EXPECT_EQ(of_bravo.find("server " + name), std::string::npos) << name;
    EXPECT_NE(of_all.find("server " + name), std::string::npos) << name;
  }
  EXPECT_NE(of_alpha.find(alpha_.id("mission")), std::string::npos);
  for (auto* client : {&alpha, &bravo, &all}) (*client)->on_close();
}

// Who flies must have the alarms: those of its own missions and of the whole server, and no other's.
TEST_P(SiteTokenStream, ShowsAlarmsOfTheServerAndOfItsMissions) {
  const auto alarm = [](const char* id, std::optional<MissionId> mission, bool of_sites) {
    return api::Alarm{{id, api::AlarmPriority::warning, "text", mission, of_sites}, {}, false};
  };
  const MissionId of_alpha{parse_uuid(alpha_.id("mission")).value()};
  const auto site = app_->hub().site_of(of_alpha);
  ASSERT_TRUE(site);
  const auto& alpha = alpha_.who.sites;
  const auto& bravo = bravo_.who.sites;
  EXPECT_TRUE(api::concerns(alarm("storage.readonly", {}, false), {}, bravo));
  EXPECT_TRUE(api::concerns(alarm("rtk.lost", of_alpha, false), site, alpha));
  EXPECT_FALSE(api::concerns(alarm("rtk.lost", of_alpha, false), site, bravo));
  EXPECT_FALSE(api::concerns(alarm("anchor.contradicted", {}, true), {}, alpha)) << "names anchors of both";
  EXPECT_TRUE(api::concerns(alarm("anchor.contradicted", {}, true), {}, SiteSet{}));

  auto client = listen(bravo_.who), all = listen(api::local_principal());
  std::string to_client, to_late, to_all;
  const auto has = [](const std::string& got, const char* what) {
    return got.find(what) != std::string::npos;
  };
  const auto publish = [&] {
    app_->hub().publish_parts(api::Topic::alarms, R"(["whole"])", 1,
                              [](const SiteSet&) { return R"(["part"])"; });
  };
  // The server publishes its own alarms each second, which may take the place of these before they are read:
  // again, for each of the three.
  const auto see = [&](std::string& got, const char* what, const auto& read) {
    for (int i = 0; i < 20 && !has(got, what); ++i) {
      publish();
      got += read();
    }
  };
  see(to_client, "[\"part\"]", [&] { return frames(*client); });
  see(to_all, "[\"whole\"]", [&] { return frames(*all); });
  see(to_late, "[\"part\"]", [&] {
    auto late = listen(bravo_.who);
    auto got = frames(*late);
    late->on_close();
    return got;
  });
  for (const auto& got : {to_client, to_late}) {
    EXPECT_TRUE(has(got, "[\"part\"]")) << got;
    EXPECT_FALSE(has(got, "[\"whole\"]")) << got;
  }
  EXPECT_TRUE(has(to_all, "[\"whole\"]")) << to_all;
  for (auto* one : {&client, &all}) (*one)->on_close();
}

TEST_P(SiteTokenStream, AResumedStreamLeavesOutWhatWasOfAnotherSite) {
  fly(alpha_, alpha_.id("mission"), 5);
  auto bravo = app_->ws_factory()(bravo_.who, [] { return true; });
  bravo->on_open([] {});
  for (const char* topic : {"events", "ranges", "fixes", "revisions"})
    bravo->on_text(Json{
        {"op", "sub"}, {"id", 1}, {"topic", topic}, {"since", {{"epoch", app_->hub().epoch()}, {"seq", 0}}}}
                       .dump());
  const auto got = frames(*bravo);
  EXPECT_EQ(betrayed(alpha_, got), "") << got;
  EXPECT_NE(betrayed(bravo_, got), "") << got;
  bravo->on_close();
}

INSTANTIATE_TEST_SUITE_P(Bound, SiteTokenStream, ::testing::Values(Bound::to_sites, Bound::to_organization),
                         bound_name);

}  // namespace
}  // namespace anchord::test::site_tokens_stream_test
