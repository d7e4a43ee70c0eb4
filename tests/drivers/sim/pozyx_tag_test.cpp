#include "drivers/sim/pozyx_tag.hpp"

#include <gtest/gtest.h>

#include "drivers/pozyx/diagnostics.hpp"
#include "tests/drivers/pozyx/transcript.hpp"
#include "tests/drivers/sim/pozyx_host.hpp"

namespace anchord::sim::pozyx_tag_test {
namespace {

TEST(SimulatedTag, AnswersTheConversationsOfTheProtocolDescription) {
  for (const char* name : {"local.txt", "client.txt", "remote.txt"}) {
    Host host(open_field());
    for (const pozyx::Exchange& line : transcript(name)) {
      std::string answer = host.ask(line.question);
      // What was measured differs, and a tag that is asked at once has no event yet: the form has to be
      // right.
      EXPECT_EQ(answer.size(), line.answer.size()) << name << " " << line.question;
      EXPECT_EQ(answer.substr(0, 2), line.answer.substr(0, 2));
      if (line.question.starts_with("F,")) {
        EXPECT_EQ(answer.substr(0, 4), line.answer.substr(0, 4)) << line.question;
      }
      for (const char* fixed : {"R,00,1", "R,1a,2", "R,1A,2", "F,c6,0160,13", "R,6c,0"}) {
        if (line.question == fixed) {
          EXPECT_EQ(answer, line.answer);
        }
      }
      if (line.question.starts_with("F,c1") || line.question.starts_with("F,b3")) host.now_s += 0.5;
      while (line.question.starts_with("F,c1") &&
             host.ask("R,81,1") != "D,03") {  // devices are missed at random
        host.ask(line.question);
        host.now_s += 0.5;
        ASSERT_LT(host.now_s, 60);
      }
    }
  }
}

TEST(SimulatedTag, EndsARangingAfterItsAirTimeWithAPlausibleRange) {
  Host host(open_field());
  const double before_s = host.now_s;
  EXPECT_EQ(host.range("0160"), 0x10);
  EXPECT_NEAR(host.now_s - before_s, 0.027 + 0.003, 0.006);  // 4096 symbols at 110 kbit/s, questions of 1 ms
  const RangeInfo info = host.info("0160");
  EXPECT_NEAR(info.distance_mm, 4000 + 80, 200);
  EXPECT_NEAR(info.rss_dbm, -71, 6);  // Friis at 4 m: -14.3 - 44.5 - 12.0
  EXPECT_NEAR(info.time_ms, host.now_s * 1000, 40);
  EXPECT_EQ(host.ask("R,81,1"), "D,01") << "the ranged device enters the list";
  EXPECT_EQ(host.ask("R,05,1"), "D,00") << "reading clears";
}

TEST(SimulatedTag, FailsToRangeToADeviceThatIsNotThereAndShowsNonsense) {
  Host host(open_field());
  EXPECT_EQ(host.range("9999"), 0x01);
  EXPECT_EQ(host.ask("R,04,1"), "D,12");
  EXPECT_EQ(host.info("9999"), (RangeInfo{0, 167772160, 8192}));
}

TEST(SimulatedTag, KeepsTheImpulseResponseUntilTheNextReception) {
  Host host(open_field());
  host.range("0160");
  const auto whole = [&] {
    std::vector<std::int16_t> taps;
    for (std::size_t at = 0; at < 1016; at += 49) {
      const std::size_t n = std::min<std::size_t>(49, 1016 - at);
      Bytes parameters;
      put_u16(parameters, static_cast<std::uint16_t>(at));
      parameters.push_back(static_cast<std::uint8_t>(n));
      std::string question = function_line(0xc8, parameters, 4 * n + 1);
      question.pop_back();
      const Bytes reply = parse_reply(host.ask(question), 4 * n + 1).value();
      for (std::size_t i = 0; i < 2 * n; ++i) taps.push_back(i16_at(reply, 1 + 2 * i));
    }
    return taps;
  };
  const auto first = whole();
  EXPECT_EQ(first.size(), 2032u);
  EXPECT_EQ(first, whole());
  const auto d = diagnose({first, {}, 0}, host.info("0160").rss_dbm, 121.74);
  ASSERT_TRUE(d);
  EXPECT_NEAR(d->first_path_idx, 746, 20);
  host.range("0260");
  EXPECT_NE(first, whole());
  EXPECT_EQ(host.ask("F,c8,c80332,201"), "D,00") << "50 coefficients are too many";
  EXPECT_EQ(host.ask("F,c8,f80301,5"), "D,00") << "there is no coefficient 1016";
}

// A published reader asks for 49 coefficients at each of 0, 49 .. 980, in room for 48: the last ones do not
// exist.
TEST(SimulatedTag, AnswersAReadOfTheImpulseResponseBeyondItsEnd) {
  Host host(open_field());
  host.range("0160");
  const std::string last = host.ask("F,c8,d40324,145"), beyond = host.ask("F,c8,d40331,193");
  EXPECT_EQ(beyond.size(), 2 + 2 * 193u);
  EXPECT_EQ(beyond.substr(0, last.size()), last);
  EXPECT_EQ(beyond.substr(last.size()), std::string(2 * 48, '0'));
}

TEST(SimulatedTag, RangesBetweenTwoOthers) {
  Host host(open_field());
  host.ask("R,05,1");
  EXPECT_EQ(host.ask("F,b2,00b50260,1"), "D,01");
  host.ask("R,05,1");
  EXPECT_EQ(host.ask("F,b3,016008,1"), "D,01");
  EXPECT_TRUE(host.poll(0x10, 1));
  EXPECT_EQ(host.ask("R,82,3"), "D,016001");
  EXPECT_EQ(host.ask("F,b4,0001,2"), "D,0101");
  EXPECT_EQ(host.poll(0x08, 0.5), 0x08);
  EXPECT_EQ(host.ask("R,82,3"), "D,016004");
  const Bytes pushed = parse_reply(host.ask("F,b4,0004,5"), 5).value();
  EXPECT_NEAR(u32_at(pushed, 1), 5657 + 80, 200);  // 4 m and 4 m at right angles
}

// The maker's Python client sleeps between its questions: the result of a fast remote exchange must not
// overwrite the acknowledgement that it has not read yet.
TEST(SimulatedTag, KeepsTheAcknowledgementUntilASlowHostHasReadIt) {
  Scenario scenario = open_field();
  scenario.tags[0].range_s = 0.005;
  Host host(scenario);
  host.ask("F,b2,00b50260,1");
  host.ask("R,05,1");
  EXPECT_EQ(host.ask("F,b3,016008,1"), "D,01");
  EXPECT_EQ(host.poll(event::func, 0.5), event::func);
  host.now_s += 0.05;
  EXPECT_EQ(host.ask("R,82,3"), "D,016001");
  host.now_s += 0.02;
  EXPECT_EQ(host.ask("F,b4,0001,2"), "D,0101");
  EXPECT_EQ(host.poll(event::rx_data, 0.1), event::rx_data);
  EXPECT_EQ(host.ask("R,82,3"), "D,016004");
  // Nobody reads: it comes all the same.
  host.ask("F,b2,00b50260,1");
  host.ask("F,b3,016008,1");
  host.now_s += 0.3;
  EXPECT_EQ(host.ask("R,05,1"), "D,18");
}

TEST(SimulatedTag, EndsACommandAtACarriageReturnAlone) {
  Host host(open_field());
  const auto said = [&](std::string_view bytes) {
    host.tag.receive(bytes, host.now_s);
    host.now_s += 0.01;
    return host.tag.speak(host.now_s);
  };
  EXPECT_EQ(said("R,00,1\r"), "D,43\r\n");
  EXPECT_EQ(said("R,00,1\r\nR,1a,2\r\n"), "D,43\r\nD,0060\r\n") << "CR LF, two in one write";
  EXPECT_EQ(said("r,1A,2\r"), "D,0060\r\n");
  EXPECT_EQ(said("R,0"), "");
  EXPECT_EQ(said("0,1\r"), "D,43\r\n") << "a command in two pieces";
  EXPECT_EQ(said("R,00,1\n"), "");
  EXPECT_EQ(said("R,00,1\r"), "") << "an LF in the middle of a line is noise";
  EXPECT_EQ(said("R,00,1\r"), "D,43\r\n");
  EXPECT_EQ(said(std::string(5000, '#') + "\rR,00,1\r"), "D,43\r\n") << "garbage";
}

TEST(SimulatedTag, BeginsAnewWithTheNextHost) {
  Host host(open_field());
  host.tag.receive("R,1a,2\rR,0", host.now_s);
  host.tag.opened();
  EXPECT_EQ(host.tag.speak(host.now_s + 1), "") << "an answer nobody waits for any more";
  host.now_s += 1;
  EXPECT_EQ(host.ask("R,00,1"), "D,43");
}

TEST(SimulatedTag, GivesItsPositionWithDataOnNewerFirmwareOnly) {
  Scenario scenario = open_field();
  scenario.world.anchors.push_back({{0x6004}, {0, -4, 1}});
  Host host(scenario);
  host.ask("F,c4,016001a00f00000000000000000000,1");  // (4000, 0, 0) mm and so on
  host.ask("F,c4,02600100000000a00f000000000000,1");
  host.ask("F,c4,03600160f0ffff0000000000000000,1");
  host.ask("F,c4,0460010000000060f0ffffe8030000,1");
  host.ask("R,05,1");
  EXPECT_EQ(host.ask("F,b6,,1"), "D,01");
  EXPECT_NE(host.poll(event::pos | event::err, 1) & event::pos, 0);
  const std::string position = host.ask("R,30,12"), with_data = host.ask("F,cc,0100,73");
  // Three coordinates, a status, and zeros up to what was asked for.
  EXPECT_EQ(with_data, "D,01" + position.substr(2) + "01" + std::string(2 * 59, '0'));
  scenario.tags[0].firmware = 0x11;
  Host old(scenario);
  EXPECT_EQ(old.ask("F,cc,0100,73"), "D,00");
}

TEST(SimulatedTag, ForgetsTheGainWithNewSettingsAndHearsNobodyWithOthers) {
  Host host(open_field());
  host.ask("W,1f,30");
  EXPECT_EQ(host.ask("R,1f,1"), "D,30");
  host.ask("W,1d,8108");
  EXPECT_EQ(host.ask("R,1c,4"), "D,05810817");
  EXPECT_EQ(host.range("0160"), 0x01);
  host.ask("W,1d,800c");
  EXPECT_EQ(host.range("0160"), 0x10);
}

TEST(SimulatedTag, SaysTheSameBytesWithTheSameSeed) {
  const auto run = [](std::uint64_t seed) {
    Scenario scenario = open_field();
    scenario.seed = seed;
    Host host(scenario);
    for (int i = 0; i < 20; ++i) {
      host.range(i % 2 ? "0160" : "0260");
      host.info(i % 2 ? "0160" : "0260");
      host.ask("F,c8,ea0220,129");
    }
    return host.all;
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
}

TEST(SimulatedTag, HasTheFailuresOfItsScenario) {
  Scenario scenario = open_field();
  const auto fault = [&](FaultKind kind, double from_s) {
    scenario.faults.push_back({"tag", kind, from_s, from_s + 10});
  };
  fault(FaultKind::silence, 10);
  fault(FaultKind::late, 20);
  fault(FaultKind::stale, 30);
  fault(FaultKind::zero, 40);
  fault(FaultKind::no_event, 50);
  fault(FaultKind::refuse, 60);
  fault(FaultKind::garbage, 70);
  Host host(scenario);
  host.range("0160");
  const RangeInfo good = host.info("0160");
  host.now_s = 10;
  EXPECT_EQ(host.ask("R,00,1"), "");
  host.now_s = 20;
  EXPECT_EQ(host.ask("R,00,1"), "") << "not within 100 ms";
  host.now_s = 30;
  EXPECT_EQ(host.tag.speak(host.now_s), "D,43\r\n") << "but later";
  EXPECT_EQ(host.range("0160"), 0x10);
  EXPECT_EQ(host.info("0160"), good);
  host.now_s = 40;
  EXPECT_EQ(host.range("0160"), 0x10);
  EXPECT_EQ(host.info("0160").distance_mm, 0u);
  host.now_s = 50;
  EXPECT_EQ(host.range("0160"), 0);
  host.now_s = 60;
  EXPECT_EQ(host.ask("F,b5,0160,1"), "D,00");
  EXPECT_EQ(host.ask("F,c7,0160,11"), "D,00") << "a short answer";
  host.now_s = 70;
  std::string noisy;
  for (int i = 0; i < 50; ++i) {
    host.tag.receive("R,00,1\r", host.now_s += 0.01);
    noisy += host.tag.speak(host.now_s);
  }
  EXPECT_GT(noisy.size(), 50 * 6u);
  host.tag.power_up(90);
  EXPECT_EQ(host.tag.speak(90), "");
}

}  // namespace
}  // namespace anchord::sim::pozyx_tag_test
