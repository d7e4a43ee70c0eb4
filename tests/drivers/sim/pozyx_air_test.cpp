#include "drivers/sim/pozyx_air.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include "drivers/sim/pozyx_position.hpp"
#include "tests/drivers/sim/pozyx_host.hpp"
#include "tests/paths.hpp"

namespace anchord::sim::pozyx_air_test {
namespace {

/// Four anchors in the open that determine a position, tags 0x6000 and 0x6010 a metre apart; nothing is lost.
Scenario two_tags() {
  Scenario scenario = open_field();
  scenario.world.anchors = {
      {{0x6001}, {0, 0, 2}}, {{0x6002}, {12, 0, 2.5}}, {{0x6003}, {12, 9, 1.5}}, {{0x6004}, {0, 9, 3}}};
  scenario.path[0].enu_m = {5, 4, 1.2};
  TagSetup other = scenario.tags[0];
  other.name = "other";
  other.id = {0x6010};
  other.lever_arm_m = {1, 0, 0};
  scenario.tags.push_back(other);
  return scenario;
}

bool matches(const std::string& answer, const std::string& wanted) {
  return answer.size() == wanted.size() &&
         std::equal(answer.begin(), answer.end(), wanted.begin(),
                    [](char is, char wants) { return is == wants || (wants == '?' && std::isxdigit(is)); });
}

/// Plays tests/data/captures/pozyx/NAME to the simulated tags and compares every answer.
void play(const std::string& name, Scenario scenario) {
  Host first(std::move(scenario));
  std::map<int, Host*> hosts{{1, &first}};
  std::unique_ptr<Host> second;
  if (first.scenario->tags.size() > 1) second = std::make_unique<Host>(first, 1);
  if (second) hosts[2] = second.get();
  Host* host = &first;
  std::ifstream file(std::string(ANCHORD_TEST_DATA) + "/captures/pozyx/" + name);
  ASSERT_TRUE(file) << name;
  int number = 0, answers = 0;
  std::string answer;
  for (std::string line; std::getline(file, line);) {
    ++number;
    const std::string rest = line.size() > 2 ? line.substr(2) : std::string();
    if (line.starts_with("+ ")) host->now_s += std::stod(rest);
    if (line.starts_with("> ")) answer = host->ask(rest);
    if (line.starts_with("@ ")) {
      Host* next = hosts.at(std::stoi(rest));
      next->now_s = std::max(next->now_s, host->now_s);
      host = next;
    }
    if (!line.starts_with("< ")) continue;
    ++answers;
    EXPECT_TRUE(matches(answer, rest)) << name << ":" << number << " " << answer << ", not " << rest;
  }
  EXPECT_GT(answers, 10);
}

TEST(SimulatedTags, TalkToEachOtherAsTheDescriptionHasIt) { play("two_tags.txt", two_tags()); }
TEST(SimulatedTags, KeepInFlashWhatWasSaved) { play("flash.txt", open_field()); }
TEST(SimulatedTags, RefuseWithTheErrorCodeOfTheDescription) { play("refusals.txt", open_field()); }

/// Coordinates of the scenario's anchors into the device list, by wire or by radio.
void tell_anchors(Host& host, const std::string& before = "F,c4,", const std::string& after = ",1") {
  for (const WorldAnchor& anchor : host.scenario->world.anchors) {
    const Bytes added =
        device_add_parameters({static_cast<std::uint16_t>(anchor.id.value), true, anchor.enu_m}).value();
    EXPECT_EQ(host.ask(before + hex(added) + after), "D,01");
    if (before == "F,c4,") continue;
    EXPECT_EQ(host.ask("F,b3,106008,1"), "D,01");
    EXPECT_EQ(host.poll(event::func | event::err, 0.5), event::func);
  }
}

TEST(SimulatedTags, PositionInTheFrameOfTheirDeviceList) {
  Scenario scenario = two_tags();
  scenario.tags[0].firmware = 0x11;
  Host host(scenario);
  // The list is in another frame than the scenario: 100 m east, 50 m south, 10 m up.
  const Eigen::Vector3d shift_m(100, -50, 10);
  for (const WorldAnchor& anchor : scenario.world.anchors) {
    const auto id = static_cast<std::uint16_t>(anchor.id.value);
    host.ask("F,c4," + hex(device_add_parameters({id, true, anchor.enu_m + shift_m}).value()) + ",1");
  }
  const auto position_m = [&] {
    host.ask("R,05,1");
    EXPECT_EQ(host.ask("F,b6,0100,1"), "D,01");
    EXPECT_EQ(host.poll(event::pos | event::err, 0.2), event::pos) << "the maker's client waits 200 ms";
    return coordinates_m(parse_reply(host.ask("R,30,12"), 12).value());
  };
  const Eigen::Vector3d truth_m = Eigen::Vector3d(5, 4, 1.2) + shift_m;
  EXPECT_LT((position_m() - truth_m).head<2>().norm(), 0.3);
  host.ask("W,16,10");        // two and a half dimensions: the height is known
  host.ask("W,38,c02b0000");  // 11 200 mm
  EXPECT_LT((position_m() - truth_m).norm(), 0.3);
  EXPECT_EQ(host.ask("R,38,4"), "D,C02B0000");
  EXPECT_EQ(host.ask("F,b8,,9"), "D,010160026003600460") << "automatic selection tells whom it took";
}

TEST(SimulatedTags, PositionThemselvesAboveTheirAnchorsToo) {
  for (const double height_m : {-4.0, 8.0}) {
    Scenario scenario = two_tags();
    scenario.path[0].enu_m.z() = height_m;
    Host host(scenario);
    tell_anchors(host);
    host.ask("R,05,1");
    host.ask("F,b6,,1");
    EXPECT_EQ(host.poll(event::pos | event::err, 0.5), event::pos);
    EXPECT_NEAR(coordinates_m(parse_reply(host.ask("R,30,12"), 12).value()).z(), height_m, 1.0);
  }
}

TEST(SimulatedTags, FilterTheirPositionsAsRegister14Says) {
  // Root of the mean square distance of 40 positions from their mean, by the first coordinate; mm.
  const auto spread_mm = [](const std::string& filter) {
    Host host(two_tags());
    tell_anchors(host);
    host.ask("W,14," + filter);
    std::vector<double> x_mm;
    for (int i = 0; i < 80; ++i) {
      host.ask("R,05,1");
      host.ask("F,b6,,1");
      EXPECT_EQ(host.poll(event::pos | event::err, 0.5), event::pos);
      if (i >= 40) x_mm.push_back(i32_at(parse_reply(host.ask("R,30,4"), 4).value(), 0));
    }
    double mean = 0, squares = 0;
    for (const double x : x_mm) mean += x / 40;
    for (const double x : x_mm) squares += (x - mean) * (x - mean) / 40;
    return std::sqrt(squares);
  };
  const double raw_mm = spread_mm("00");
  EXPECT_GT(raw_mm, 10);
  EXPECT_EQ(spread_mm("50"), raw_mm) << "a strength without a filter";
  EXPECT_EQ(spread_mm("03"), raw_mm) << "a filter without a strength";
  // Eleven samples: 1 / sqrt(11) = 0.30, the median a quarter more, the triangle of them 0.37.
  for (const char* kind : {"51", "53", "54"}) EXPECT_LT(spread_mm(kind), 0.6 * raw_mm) << kind;
}

TEST(PositionFilter, IsLateByItsStrength) {
  std::vector<Eigen::Vector3d> way_m;
  for (int i = 0; i < 31; ++i) way_m.emplace_back(i, 2 * i, -i);
  for (const unsigned kind : {1u, 3u, 4u})
    EXPECT_LT((filter_position(way_m, kind | 7u << 4) - way_m[30 - 7]).norm(), 1e-9) << kind;
  way_m.back() = {1000, 1000, 1000};
  // Of (28, 56, -28), (29, 58, -29) and the outlier, each axis for itself.
  EXPECT_EQ(filter_position(way_m, 0x14), Eigen::Vector3d(29, 58, -28));
}

TEST(SimulatedTags, GiveNoPositionWithoutEnoughAnchorsOrFromOnePlace) {
  Host host(two_tags());
  host.ask("F,b6,,1");
  EXPECT_EQ(host.poll(event::pos | event::err, 0.5), event::err);
  EXPECT_EQ(host.ask("R,04,1"), "D,0A");
  for (const char* id : {"0160", "0260", "0360", "0460"})
    host.ask(std::string("F,c4,") + id + "01000000000000000000000000,1");
  host.ask("R,05,1");
  host.ask("F,b6,,1");
  EXPECT_EQ(host.poll(event::pos | event::err, 0.5), event::err);
  EXPECT_EQ(host.ask("R,04,1"), "D,16");
}

TEST(SimulatedTags, PushAPositionToWhoAskedForItByRadio) {
  for (const std::uint8_t firmware : {std::uint8_t{0x11}, std::uint8_t{0x13}}) {
    Scenario scenario = two_tags();
    scenario.tags[0].firmware = scenario.tags[1].firmware = firmware;
    Host host(scenario);
    tell_anchors(host, "F,b2,00c4", ",1");
    host.ask("F,b2,00b60100,1");
    host.ask("R,05,1");
    EXPECT_EQ(host.ask("F,b3,106008,1"), "D,01");
    EXPECT_EQ(host.poll(event::func | event::err, 0.5), event::func);
    EXPECT_EQ(host.ask("F,b4,0001,2"), "D,0101");
    EXPECT_EQ(host.poll(event::rx_data, 0.4), event::rx_data) << "the maker's client waits 400 ms";
    // Twelve bytes of coordinates; newer firmware adds the status.
    EXPECT_EQ(host.ask("R,82,3"), firmware == 0x11 ? "D,10600C" : "D,10600D");
    const Bytes pushed = parse_reply(host.ask("F,b4,000c,13"), 13).value();
    EXPECT_LT((coordinates_m(ByteView(pushed).subspan(1)) - Eigen::Vector3d(5, 5, 1.2)).head<2>().norm(),
              0.3);
  }
}

TEST(SimulatedTags, NewerFirmwareWantsFlagsInTheRemoteForm) {
  Host host(two_tags());
  host.ask("F,b2,00b6,1");
  host.ask("F,b3,106008,1");
  host.now_s += 0.1;
  EXPECT_EQ(host.ask("F,b4,0001,2"), "D,0100");
  Host other(host, 1);
  EXPECT_EQ(other.ask("R,04,1"), "D,0D");  // issue 52 of the maker's library
}

TEST(SimulatedTags, AddSensorsAndRangesToAPositionWithData) {
  Host host(two_tags());
  tell_anchors(host);
  host.ask("F,b6,,1");
  host.now_s += 0.3;
  // 13 of the position, 6 of the acceleration, a count, 4 x (id, mm). The client asks for 61 bytes more than
  // the first three take: room for ten ranges, zeros where there are fewer.
  const std::string answer = host.ask("F,cc,0380,81");
  ASSERT_EQ(answer.size(), 2 + 2 * 81u);
  EXPECT_EQ(answer.substr(2 + 2 * (1 + 13 + 6 + 1 + 4 * 6)), std::string(2 * 36, '0'));
  EXPECT_EQ(answer.substr(2, 2), "01");
  EXPECT_EQ(answer.substr(2 + 2 * 14, 12), "00000000E803") << "1000 mg down";
  EXPECT_EQ(answer.substr(2 + 2 * 20, 6), "040160");
  const Bytes mm = unhex(answer.substr(2 + 2 * 23, 8)).value();
  EXPECT_NEAR(u32_at(mm, 0), 6453, 300);  // (5, 4, -0.8) m
  EXPECT_EQ(host.ask("F,cc,0004,64"), "D,00") << "a flag without a meaning";
}

TEST(SimulatedTags, PositionAgainAndAgainWithAnInterval) {
  Host host(two_tags());
  tell_anchors(host);
  host.ask("R,05,1");
  host.ask("W,18,c800");
  for (int i = 0; i < 3; ++i) EXPECT_EQ(host.poll(event::pos, 0.25), event::pos);
  host.ask("F,b6,,1");  // a single one ends it
  EXPECT_EQ(host.poll(event::pos, 0.25), event::pos);
  EXPECT_EQ(host.poll(event::pos, 1.0), 0);
  EXPECT_EQ(host.ask("R,18,2"), "D,0000");
}

TEST(SimulatedTags, AreFoundByTheKindOfDiscovery) {
  const auto found = [](const std::string& type) {
    Host host(two_tags());
    for (int i = 0; i < 5; ++i) {  // devices are missed at random
      host.ask("R,05,1");
      EXPECT_EQ(host.ask("F,c1," + type + "030a,1"), "D,01");
      EXPECT_EQ(host.poll(event::func | event::err, 0.23), event::func);
    }
    const std::string ids = host.ask("F,c0,,41").substr(4);
    std::set<std::string> out;
    EXPECT_EQ(ids.size(), 80u) << "room for twenty was asked for";
    for (std::size_t i = 0; i < ids.size(); i += 4) {
      if (ids.substr(i, 4) != "0000") out.insert(ids.substr(i, 4));
    }
    return out;
  };
  EXPECT_EQ(found("00"), (std::set<std::string>{"0160", "0260", "0360", "0460"}));
  EXPECT_EQ(found("01"), (std::set<std::string>{"1060"}));
  EXPECT_EQ(found("02"), (std::set<std::string>{"0160", "0260", "0360", "0460", "1060"}));
}

TEST(SimulatedTags, FindOthersWithinTheHundredMillisecondsOfSlotsBySettings) {
  Host host(two_tags());  // 4096 symbols at 110 kbit/s: the longest frames
  host.ask("F,c1,020300,1");
  EXPECT_EQ(host.poll(event::func | event::err, 0.1), event::func);
  EXPECT_NE(host.ask("R,81,1"), "D,00");
}

TEST(SimulatedTags, DoNotForgetCoordinatesInADiscovery) {
  Host host(open_field());
  host.ask("F,c4,0160012efbffff52aa0800be0a0000,1");
  for (int i = 0; i < 3; ++i) {
    host.ask("F,c1,02030a,1");
    host.now_s += 0.3;
  }
  EXPECT_EQ(host.ask("F,c6,0160,13"), "D,012EFBFFFF52AA0800BE0A0000");
}

// Any command with any parameters, over both wires, at any pace: every read and function has one answer.
TEST(SimulatedTags, AnswerWhateverTheyAreAsked) {
  for (const std::uint8_t firmware : {std::uint8_t{0x11}, std::uint8_t{0x13}}) {
    Scenario scenario = two_tags();
    scenario.tags[0].firmware = scenario.tags[1].firmware = firmware;
    Host first(scenario);
    Host second(first, 1);
    std::mt19937 random(firmware);
    const auto below = [&](unsigned n) { return static_cast<std::size_t>(random() % n); };
    constexpr std::array<const char*, 6> k_ids{"0160", "0260", "1060", "0060", "0000", "7777"};
    for (int i = 0; i < 40'000; ++i) {
      Host& host = i % 2 ? first : second;
      host.now_s = std::max(first.now_s, second.now_s) + 0.001 * static_cast<double>(below(40));
      const auto address = static_cast<std::uint8_t>(below(8) ? 0xb0 + below(0x1d) : below(256));
      Bytes parameters(below(2) ? below(18) : 0);
      for (std::uint8_t& byte : parameters)
        byte = static_cast<std::uint8_t>(below(3) ? below(6) : below(256));
      const std::string text = (below(3) ? k_ids[below(6)] : "") + hex(parameters),
                        tail = std::to_string(below(256));
      const std::size_t kind = below(8);
      if (kind == 0) {
        if (address >= 0x1a && address <= 0x1e) continue;  // they would hear nobody for the rest of the time
        host.tag.receive("W," + hex(Bytes{address}) + "," + text + "\r", host.now_s);
        continue;
      }
      std::string question =
          (kind < 3 ? "R," : "F,") + hex(Bytes{address}) + "," + (kind < 3 ? "" : text + ",") + tail;
      if (kind == 6) question = "F,b2,00" + hex(Bytes{address}) + text + ",1";
      if (kind == 7)
        question = std::string("F,b3,") + k_ids[below(6)] + "0" + std::to_string(2 * (1 + below(4))) + ",1";
      const std::string answer = host.ask(question);
      ASSERT_TRUE(answer.starts_with("D,")) << question << " " << answer;
      ASSERT_LE(answer.size(), 2 + 2 * 255u);
    }
    EXPECT_EQ(first.ask("R,00,1"), "D,43");
    EXPECT_GT(first.tag.exchanges() + second.tag.exchanges(), 50u);
  }
}

TEST(SimulatedTags, CalibrateAnchorsIntoTheMakersFrame) {
  Host host(two_tags());
  host.ask("R,05,1");
  EXPECT_EQ(host.ask("F,c2,020a0360026001600460,1"), "D,01");  // origin 0x6003, x axis through 0x6002
  EXPECT_EQ(host.poll(event::func | event::err, 25), event::func);
  const auto at_m = [&](const char* id) {
    return coordinates_m(
        ByteView(parse_reply(host.ask(std::string("F,c6,") + id + ",13"), 13).value()).subspan(1));
  };
  EXPECT_EQ(at_m("0360"), Eigen::Vector3d(0, 0, 0));
  EXPECT_NEAR(at_m("0260").x(), 9, 0.5);  // 9 m south of the origin
  EXPECT_EQ(at_m("0260").y(), 0);
  EXPECT_NEAR(at_m("0160").y(), 12, 0.5);
  EXPECT_NEAR(at_m("0460").x(), 0, 0.5);
}

TEST(SimulatedTags, HearAnAnchorAgainOnSettingsThatAnotherTagGaveIt) {
  Host host(two_tags());
  Host other(host, 1);
  host.ask("F,b2,001c03800c,1");  // remote write: channel 3
  host.ask("F,b3,016004,1");
  EXPECT_EQ(host.poll(event::func | event::err, 0.5), event::func);
  other.now_s = host.now_s;
  EXPECT_EQ(other.range("0160"), event::err);
  other.ask("W,1c,03");
  EXPECT_EQ(other.range("0160"), event::func);
}

TEST(SimulatedTags, AnswerUnderANewIdAtOnce) {
  Host host(two_tags());
  host.ask("F,b2,001a04a0,1");
  host.ask("F,b3,016004,1");
  EXPECT_EQ(host.poll(event::func | event::err, 0.5), event::func);
  EXPECT_EQ(host.range("04a0"), event::func);
  EXPECT_EQ(host.range("0160"), event::err);
}

}  // namespace
}  // namespace anchord::sim::pozyx_air_test
