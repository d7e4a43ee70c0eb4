#include "drivers/ntrip/client.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>

#include "core/base/base64.hpp"
#include "core/base/crc24q.hpp"
#include "drivers/device/settings.hpp"
#include "tests/drivers/device/collect.hpp"

namespace anchord::ntrip::client_test {
namespace {

using device::test::Collect;
using record::EventKind;

/// Message 1005 of the RTCM 10403 standard's own example: 25 bytes.
const std::string k_1005(
    "\xd3\x00\x13\x3e\xd7\xd3\x02\x02\x98\x0e\xde\xef\x34\xb4\xbd\x62\xac\x09\x41\x98\x6f\x33\x36\x0b\x98",
    25);

/// A rover in slot 1 and a caster in slot 2, behind the server's own entrance.
struct Link {
  explicit Link(const std::string& options = R"({"mount":"BASE","user":"me","version":1})") : pipeline(sink) {
    take(EventKind::added, 1,
         device::to_json(device::Settings{"r", "gnss", "", "tcp://192.0.2.1:9001", "{}"}));
    take(EventKind::added, 2,
         device::to_json(device::Settings{"c", "ntrip", "", "tcp://caster.example:2101", options}));
    take(EventKind::opened, 1);
  }
  void take(EventKind kind, std::uint16_t slot, std::string_view payload = {}) {
    const link::Arrival at{UtcTime{1'718'269'200'000'000'000 + now_ns}, now_ns};
    const auto done = pipeline.take({kind, slot, at, payload});
    EXPECT_TRUE(done) << done.error().message;
  }
  std::string to_rover() { return std::exchange(sink.sent[1], {}); }
  std::string to_caster() { return std::exchange(sink.sent[2], {}); }
  Collect sink;
  device::Pipeline pipeline;
  std::int64_t now_ns{1'000'000'000};
};

TEST(Crc24q, OfTheStandardsExampleIsItsOwn) {
  EXPECT_EQ(crc24q(std::string_view(k_1005).substr(0, 22)), 0x360b98u);
  RtcmFrames counter;
  EXPECT_EQ(counter.feed(k_1005 + "\xd3\xd3junk" + k_1005), 2);
  EXPECT_EQ(counter.newest_message(), 1005);
  EXPECT_EQ(counter.skipped(), 6u);
}

TEST(BaseStation, OfTheStandardsExampleIsItsOwn) {
  const auto base = base_station(std::string_view(k_1005).substr(3, 19));
  ASSERT_TRUE(base);
  EXPECT_EQ(base->station, 2003);
  EXPECT_NEAR(base->ecef_m[0], 1114104.5999, 1e-9);
  EXPECT_NEAR(base->ecef_m[1], -4850729.7108, 1e-9);
  EXPECT_NEAR(base->ecef_m[2], 3975521.4643, 1e-9);
  EXPECT_FALSE(base->antenna_height_m);
}

TEST(BaseStation, HasItsAntennaHeightIn1006AndIsNotGuessedFromAnythingElse) {
  // The example's number raised by one, and 1.5234 m behind it.
  std::string body(std::string_view(k_1005).substr(3, 19));
  body[1] = static_cast<char>(static_cast<unsigned char>(body[1]) + 0x10);
  EXPECT_FALSE(base_station(body)) << "1006 without its height is cut";
  body += std::string("\x3b\x82", 2);
  ASSERT_TRUE(base_station(body));
  EXPECT_NEAR(base_station(body)->antenna_height_m.value_or(0), 1.5234, 1e-9);
  std::string zeros(std::string_view(k_1005).substr(3, 19));
  std::fill(zeros.begin() + 4, zeros.end(), '\0');
  EXPECT_FALSE(base_station(zeros)) << "the centre of the earth";
  for (std::size_t n = 0; n < 19; ++n) EXPECT_FALSE(base_station(std::string_view(k_1005).substr(3, n)));
}

TEST(Base64, AsInRfc4648) {
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(NtripClient, AsksAsEachVersionAsks) {
  Link one;
  one.take(EventKind::opened, 2);
  EXPECT_EQ(one.to_caster(),
            "GET /BASE HTTP/1.0\r\nUser-Agent: NTRIP anchord/1\r\nAuthorization: Basic bWU6\r\n\r\n");
  const auto file = std::filesystem::temp_directory_path() / ("ntrip_password_" + std::to_string(getpid()));
  std::ofstream(file) << "secret\n";
  Link two(R"({"mount":"BASE","user":"me","password_file":")" + file.string() + R"("})");
  two.take(EventKind::opened, 2);
  EXPECT_EQ(two.to_caster(),
            "GET /BASE HTTP/1.1\r\nHost: caster.example:2101\r\nNtrip-Version: Ntrip/2.0\r\n"
            "User-Agent: NTRIP anchord/1\r\nAuthorization: Basic bWU6c2VjcmV0\r\nConnection: close\r\n\r\n");
  std::filesystem::remove(file);
}

TEST(NtripClient, HandsTheStreamOnWhereverTheAnswerIsCut) {
  const std::string stream = k_1005 + k_1005;
  for (const std::string& head : {std::string("ICY 200 OK\r\n"), std::string("ICY 200 OK\r\n\r\n"),
                                  std::string("ICY 200 OK\r\nServer: x\r\n\r\n"),
                                  std::string("HTTP/1.1 200 OK\r\nContent-Type: gnss/data\r\n\r\n")}) {
    const std::string all = head + stream;
    for (std::size_t cut = 1; cut < all.size(); ++cut) {
      Link link;
      link.take(EventKind::opened, 2);
      link.take(EventKind::bytes, 2, std::string_view(all).substr(0, cut));
      link.take(EventKind::bytes, 2, std::string_view(all).substr(cut));
      ASSERT_EQ(link.to_rover(), stream) << head << " cut at " << cut;
    }
  }
}

TEST(NtripClient, UndoesChunksThatCutFrames) {
  const std::string all = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n7\r\n" + k_1005.substr(0, 7) +
                          "\r\n12;x=y\r\n" + k_1005.substr(7) + "\r\n0\r\n\r\n";
  for (std::size_t cut = 1; cut < all.size(); ++cut) {
    Link link;
    link.take(EventKind::opened, 2);
    link.take(EventKind::bytes, 2, std::string_view(all).substr(0, cut));
    link.take(EventKind::bytes, 2, std::string_view(all).substr(cut));
    ASSERT_EQ(link.to_rover(), k_1005) << "cut at " << cut;
    ASSERT_EQ(link.sink.hung_up, "the caster ended the stream");
  }
}

// CFG-RST (cold start) of UBX, the same of a MediaTek receiver, and bytes that look like nothing.
TEST(NtripClient, NothingButWholeFramesWithARightSumReachesARover) {
  const std::string ubx("\xb5\x62\x06\x04\x04\x00\xff\xff\x00\x00\x0c\x5d", 12);
  std::string broken = k_1005;
  broken[10] = static_cast<char>(broken[10] ^ 1);
  for (const std::string& foreign : {ubx, std::string("$PMTK104*37\r\n"), std::string("<html>x</html>"),
                                     broken, k_1005.substr(0, 12), std::string("\xd3\xd3\xd3")}) {
    Link link;
    link.take(EventKind::opened, 2);
    link.take(EventKind::bytes, 2, "ICY 200 OK\r\n\r\n" + k_1005 + foreign);
    EXPECT_EQ(link.to_rover(), k_1005) << foreign;
    link.take(EventKind::bytes, 2, foreign + k_1005 + k_1005);
    std::string later = link.to_rover();
    // A false preamble may ask for more bytes before it shows itself false; then nothing is lost.
    for (int i = 0; i < 50; ++i) {
      link.take(EventKind::bytes, 2, k_1005);
      later += link.to_rover();
    }
    EXPECT_EQ(later.size() % k_1005.size(), 0U);
    EXPECT_GE(later.size(), 50 * k_1005.size());
    for (std::size_t at = 0; at < later.size(); at += k_1005.size())
      ASSERT_EQ(later.substr(at, k_1005.size()), k_1005) << foreign;
    EXPECT_GE(link.sink.drops["no_rtcm_bytes"], foreign == k_1005.substr(0, 12) ? 12U : foreign.size());
    EXPECT_EQ(link.sink.hung_up, "");
  }
}

TEST(NtripClient, AFrameGoesToTheRoverWithItsLastByte) {
  Link link;
  link.take(EventKind::opened, 2);
  link.take(EventKind::bytes, 2, "ICY 200 OK\r\n\r\n" + k_1005.substr(0, 24));
  EXPECT_EQ(link.to_rover(), "");
  link.take(EventKind::bytes, 2, k_1005.substr(24));
  EXPECT_EQ(link.to_rover(), k_1005);
}

TEST(NtripClient, RefusesAWebPageByItsNameOrByItsText) {
  const std::string why =
      "the caster sends a web page (HTML): check address, port and mount, or sign in to this network's login "
      "page";
  const std::string page = "<html><body>Login</body></html>\n";
  for (const std::string& head :
       {std::string("HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\n\r\n"),
        std::string("ICY 200 OK\r\n"), std::string("HTTP/1.0 200 OK\r\n")}) {
    Link link;
    link.take(EventKind::opened, 2);
    link.take(EventKind::bytes, 2, head + page);
    EXPECT_EQ(link.to_rover(), "");
    EXPECT_EQ(link.sink.hung_up, why) << head;
  }
  Link without_a_type;
  without_a_type.take(EventKind::opened, 2);
  without_a_type.take(EventKind::bytes, 2, "HTTP/1.1 200 OK\r\n\r\n");
  without_a_type.take(EventKind::bytes, 2, "\r\n" + page + std::string(70'000, 'x'));
  EXPECT_EQ(without_a_type.sink.hung_up, why);
}

TEST(NtripClient, AStreamWithoutAFrameEndsAfter64KiBAndAMixedOneIsNamed) {
  Link link;
  link.take(EventKind::opened, 2);
  link.take(EventKind::bytes, 2, "ICY 200 OK\r\n\r\n" + k_1005);
  for (int i = 0; i < 64; ++i) link.take(EventKind::bytes, 2, std::string(1000, 'x'));
  EXPECT_EQ(link.sink.hung_up, "");
  EXPECT_EQ(link.sink.notices[2],
            "a part of what the caster sends is no RTCM 3 and does not go to receivers (no_rtcm_bytes)");
  for (int i = 0; i < 2; ++i) link.take(EventKind::bytes, 2, std::string(1000, 'x'));
  EXPECT_EQ(
      link.sink.hung_up,
      "the caster sends bytes that are no RTCM 3, which do not go to receivers: choose a mount of RTCM 3");
  EXPECT_EQ(link.to_rover(), k_1005);
}

TEST(NtripClient, AMountThatSendsNothingIsNamedUntilAFrameComes) {
  Link link;
  link.take(EventKind::opened, 2);
  link.take(EventKind::bytes, 2, "ICY 200 OK\r\n\r\n");
  const auto wait = [&](int seconds) {
    for (int i = 0; i < seconds; ++i) {
      link.now_ns += 1'000'000'000;
      link.take(EventKind::tick, 2);
    }
  };
  wait(15);
  EXPECT_EQ(link.sink.notices[2], "");
  wait(10);
  EXPECT_NE(link.sink.notices[2].find(
                "sends no corrections: a mount of a network waits for the position of a rover"),
            std::string::npos)
      << link.sink.notices[2];
  link.take(EventKind::bytes, 2, k_1005);
  EXPECT_EQ(link.sink.notices[2], "");
  wait(25);
  EXPECT_NE(link.sink.notices[2].find("sends no corrections"), std::string::npos);
}

TEST(NtripClient, AFloodOfGoodFramesIsHeldToWhatAReceiversLinkCarries) {
  Link link;
  link.take(EventKind::opened, 2);
  link.take(EventKind::bytes, 2, "ICY 200 OK\r\n\r\n");
  std::string many;
  for (int i = 0; i < 400; ++i) many += k_1005;  // 10 kB
  for (int i = 0; i < 100; ++i) {                // 1 MB in ten seconds
    link.now_ns += 100'000'000;
    link.take(EventKind::bytes, 2, many);
  }
  const auto passed = link.to_rover().size();
  EXPECT_LE(passed, 11u * 32 * 1024 + 65'536);  // its burst, and ten seconds of the rate
  EXPECT_GE(passed, 10u * 32 * 1024);
  EXPECT_GT(link.sink.drops["too_many_corrections"], 20'000u);
  EXPECT_NE(link.sink.notices[2].find("32 KiB/s"), std::string::npos);
}

TEST(NtripClient, SaysWhyThereIsNoStream) {
  const auto why = [](const std::string& answer) {
    Link link;
    link.take(EventKind::opened, 2);
    link.take(EventKind::bytes, 2, answer);
    EXPECT_EQ(link.to_rover(), "");
    return link.sink.hung_up;
  };
  EXPECT_EQ(why("HTTP/1.0 401 Unauthorized\r\n"), "the caster rejects the user or the password");
  EXPECT_EQ(why("HTTP/1.1 404 Not Found\r\n"), "the caster has no mount \"BASE\"");
  EXPECT_EQ(why("HTTP/1.1 503 Busy\r\n"), "the caster answers \"HTTP/1.1 503 Busy\"");
  EXPECT_EQ(why("SOURCETABLE 200 OK\r\nServer: x\r\n\r\nCAS;a;b\r\nSTR;NEAR;Gent;RTCM "
                "3.2;\r\nSTR;FAR;x;\r\nENDSOURCETABLE\r\n"),
            "the caster has no mount \"BASE\"; it has NEAR, FAR");
  EXPECT_EQ(why(std::string(20'000, 'x')), "the caster's answer is not NTRIP");
  // In Latin-1, and cut at 80 bytes: the text is UTF-8 and ends between characters.
  EXPECT_EQ(why("ICY 4\xff\xfe"
                "1 Nicht erlaubt\r\n"),
            "the caster answers \"ICY 4\xef\xbf\xbd\xef\xbf\xbd"
            "1 Nicht erlaubt\"");
  EXPECT_EQ(why(std::string(79, 'x') + "\xc3\xbc und mehr\r\n"),
            "the caster answers \"" + std::string(79, 'x') + "\"");
  EXPECT_EQ(why("SOURCETABLE 200 OK\r\n\r\nSTR;M\xfcnchen;x\r\nENDSOURCETABLE\r\n"),
            "the caster has no mount \"BASE\"; it has M\xef\xbf\xbdnchen");
  Link silent;
  silent.take(EventKind::opened, 2);
  silent.now_ns += 11'000'000'000;
  silent.take(EventKind::tick, 2);
  EXPECT_EQ(silent.sink.hung_up, "no answer from the caster within 10 s");
}

TEST(NtripClient, TellsTheRoversPositionAtOnceAndEachTenSeconds) {
  Link link;
  // Section 3 of the NMEA description, with its date.
  link.take(EventKind::bytes, 1,
            "$GNRMC,090000.20,A,5101.3687380,N,00342.6274020,E,0.70,109.44,130624,,,D*47\r\n"
            "$GNGGA,090000.20,5101.3687380,N,00342.6274020,E,4,14,0.9,22.500,M,45.012,M,0.8,0000*65\r\n");
  link.now_ns += 100'000'000;
  link.take(EventKind::tick, 1);
  link.take(EventKind::opened, 2);
  (void)link.to_caster();
  link.take(EventKind::bytes, 2, "ICY 200 OK\r\n\r\n");
  const std::string told = link.to_caster();
  EXPECT_TRUE(told.starts_with("$GPGGA,090000.00,5101.3687,N,00342.6274,E,4,14,0.9,22.500,M,45.012,M,,*"))
      << told;
  link.now_ns += 10'000'000'000;
  ASSERT_LE(link.pipeline.deadline_ns(2).value_or(INT64_MAX), link.now_ns);
  link.take(EventKind::tick, 2);
  EXPECT_EQ(link.to_caster(), told);
}

TEST(NtripClient, LeavesARoverAloneThatHasItsOwnCorrections) {
  Collect sink;
  device::Pipeline pipeline(sink);
  const auto take = [&](EventKind kind, std::uint16_t slot, std::string_view payload) {
    EXPECT_TRUE(pipeline.take({kind, slot, {}, payload}));
  };
  take(EventKind::added, 1,
       device::to_json(device::Settings{"r", "gnss", "", "tcp://192.0.2.1:1", R"({"corrections":"own"})"}));
  take(EventKind::added, 2,
       device::to_json(device::Settings{"c", "ntrip", "", "tcp://a:1", R"({"mount":"M"})"}));
  take(EventKind::opened, 1, {});
  take(EventKind::opened, 2, {});
  take(EventKind::bytes, 2, "ICY 200 OK\r\n\r\n" + k_1005);
  EXPECT_EQ(sink.sent[1], "");
}

TEST(NtripClient, RefusesSettingsThatWouldBreakTheRequest) {
  Collect sink;
  device::Pipeline pipeline(sink);
  for (const char* options : {R"({})", R"({"mount":"a b"})", R"({"mount":"a\r\nX: y"})",
                              R"({"mount":"M","version":3})", R"({"mount":"M","password":"x"})"}) {
    EXPECT_FALSE(pipeline.take(
        {EventKind::added, 1, {}, device::to_json(device::Settings{"c", "ntrip", "", "tcp://a:1", options})}))
        << options;
  }
}

}  // namespace
}  // namespace anchord::ntrip::client_test
