// Who on the aircraft's link is the aircraft: taken once, kept, counted against strangers; with a key only
// signed frames count.
#include "drivers/drone/peer_gate.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "drivers/drone/signing_key.hpp"

namespace anchord::drone::peer_gate_test {
namespace {

using mavlink::Address;
using mavlink::Message;
using mavlink::Packer;

constexpr std::int64_t k_signed_us = 1'777'888'800'000'000;
const std::string k_aircraft = "192.0.2.10:14550", k_stranger = "192.0.2.66:4000";

Message heartbeat(bool armed = false) {
  return Message("HEARTBEAT").set("type", 2).set("autopilot", 3).set("base_mode", armed ? 0x89 : 0x09);
}

struct Link {
  explicit Link(std::optional<mavlink::Secret> key = {}) : gate(key) {}
  bool receive(const std::string& sender, const std::vector<std::uint8_t>& bytes) {
    return gate.admits(now, k_signed_us + static_cast<std::int64_t>(now * 1e6), sender, bytes);
  }
  PeerGate gate;
  double now{0};
};

TEST(PeerGate, TakesTheFirstAutopilotAndKeepsItAgainstStrangers) {
  Link link;
  Packer copter({1, 1}), other({1, 1}), station({255, 190});
  EXPECT_FALSE(link.receive(k_stranger, {'h', 'e', 'l', 'l', 'o'})) << "no MAVLink is no aircraft";
  EXPECT_FALSE(
      link.receive(k_stranger, station.pack(Message("HEARTBEAT").set("type", 6).set("autopilot", 8))));
  EXPECT_FALSE(link.receive(k_aircraft, copter.pack(Message("SYS_STATUS")))) << "not before its heartbeat";
  EXPECT_TRUE(link.receive(k_aircraft, copter.pack(heartbeat())));
  EXPECT_EQ(link.gate.peer(), k_aircraft);
  for (int i = 0; i < 50; ++i) {
    link.now += 1;
    EXPECT_FALSE(link.receive(k_stranger, other.pack(heartbeat())))
        << "one datagram took the aircraft before";
    EXPECT_TRUE(link.receive(k_aircraft, copter.pack(heartbeat())));
  }
  EXPECT_EQ(link.gate.peer(), k_aircraft);
  std::uint64_t counted = 0;
  for (const auto& one : link.gate.others(link.now)) {
    EXPECT_EQ(one.sender == k_stranger || one.system == 1, true);
    if (one.sender == k_stranger && one.kind == "autopilot") counted = one.frames;
  }
  EXPECT_EQ(counted, 50u);
}

TEST(PeerGate, AnotherIsTakenAfterTenSecondsOfSilenceOnly) {
  Link link;
  Packer copter({1, 1}), other({2, 1});
  ASSERT_TRUE(link.receive(k_aircraft, copter.pack(heartbeat())));
  link.now = 9.9;
  EXPECT_FALSE(link.receive(k_stranger, other.pack(heartbeat())));
  link.now = 10.1;
  EXPECT_TRUE(link.receive(k_stranger, other.pack(heartbeat())));
  EXPECT_EQ(link.gate.peer(), k_stranger);
}

TEST(PeerGate, AnAircraftThatWasArmedIsFollowedByItsOwnSystemIdAlone) {
  Link link;
  Packer copter({1, 1}), other({2, 1});
  ASSERT_TRUE(link.receive(k_aircraft, copter.pack(heartbeat(true))));
  link.now = 30;
  EXPECT_FALSE(link.receive(k_stranger, other.pack(heartbeat())));
  EXPECT_TRUE(link.receive("192.0.2.10:50001", copter.pack(heartbeat(true)))) << "its radio has a new port";
}

TEST(PeerGate, TheAircraftOfAFlightThatGoesOnIsWaitedFor) {
  Link link;
  Packer copter({1, 1}), other({66, 1}), forger({1, 1});
  link.now = 100;
  link.gate.expect(link.now, {k_aircraft, 1, 1});
  EXPECT_FALSE(link.receive(k_stranger, other.pack(heartbeat(true)))) << "first on the link, and not ours";
  EXPECT_FALSE(link.receive(k_stranger, forger.pack(heartbeat(true)))) << "our id from elsewhere";
  link.now = 105;
  EXPECT_TRUE(link.receive(k_aircraft, copter.pack(heartbeat(true))));
  EXPECT_EQ(link.gate.peer(), k_aircraft);
}

TEST(PeerGate, TheAircraftOfAFlightThatGoesOnMayComeFromAnotherPortAfterTenSeconds) {
  Link link;
  Packer copter({1, 1}), other({66, 1});
  link.gate.expect(link.now, {k_aircraft, 1, 1});
  link.now = 10.1;
  EXPECT_FALSE(link.receive(k_stranger, other.pack(heartbeat(true)))) << "however long it is silent";
  EXPECT_TRUE(link.receive("192.0.2.10:50001", copter.pack(heartbeat(true)))) << "its radio has a new port";
}

TEST(PeerGate, APersonChangesTheAircraftOfAFlightThatGoesOn) {
  Link link;
  Packer other({66, 1});
  link.gate.expect(link.now, {k_aircraft, 1, 1});
  link.gate.change(k_stranger);
  EXPECT_TRUE(link.receive(k_stranger, other.pack(heartbeat())));
}

TEST(PeerGate, APersonChangesIt) {
  Link link;
  Packer copter({1, 1}), other({2, 1}), third({3, 1});
  ASSERT_TRUE(link.receive(k_aircraft, copter.pack(heartbeat(true))));
  link.gate.change(k_stranger);
  EXPECT_FALSE(link.receive(k_aircraft, copter.pack(heartbeat(true))));
  EXPECT_FALSE(link.receive("192.0.2.7:1", third.pack(heartbeat())));
  EXPECT_TRUE(link.receive(k_stranger, other.pack(heartbeat())));
  link.gate.change("");
  EXPECT_TRUE(link.receive("192.0.2.7:1", third.pack(heartbeat()))) << "the next that is heard";
}

TEST(PeerGate, ThousandsOfStrangersAreAHandfulOfRows) {
  Link link;
  for (int i = 0; i < 5000; ++i) link.receive("192.0.2.1:" + std::to_string(i), {'x'});
  EXPECT_LE(link.gate.others(0).size(), 32u);
}

TEST(PeerGate, WithAKeyOnlySignedFramesTakeTheLinkAndAReplayDoesNot) {
  mavlink::Secret key{};
  key.fill(9);
  Link link(key);
  const auto stamp = mavlink::signature_time(k_signed_us);
  Packer copter({1, 1}), forger({1, 1}), other({1, 1});
  EXPECT_FALSE(link.receive(k_stranger, forger.pack(heartbeat())));
  EXPECT_EQ(link.gate.others(link.now).front().kind, "unsigned");
  mavlink::Secret wrong{};
  other.sign_with(wrong, 0, stamp);
  EXPECT_FALSE(link.receive(k_stranger, other.pack(heartbeat())));
  EXPECT_EQ(link.gate.frames_refused(), 2u);
  EXPECT_EQ(link.gate.others(link.now).front().kind, "wrong key");
  copter.sign_with(key, 0, stamp);
  const auto first = copter.pack(heartbeat());
  EXPECT_TRUE(link.receive(k_aircraft, first));
  link.now = 30;
  EXPECT_FALSE(link.receive(k_stranger, first)) << "recorded and sent again";
  link.now = 31;
  copter.set_time(stamp + 3'100'000);
  EXPECT_TRUE(link.receive("192.0.2.10:50001", copter.pack(heartbeat())));
  EXPECT_EQ(link.gate.others(link.now).front().kind, "replayed");
}

TEST(PeerGate, SaysWhyASignedLinkHearsNobody) {
  mavlink::Secret key{}, another{};
  key.fill(9);
  another.fill(8);
  const auto stamp = mavlink::signature_time(k_signed_us);
  Link link(key);
  EXPECT_EQ(link.gate.trouble(link.now, false), "") << "nobody has spoken";
  Packer plain({1, 1}), wrong({1, 1}), unset({1, 1});
  wrong.sign_with(another, 0, stamp);
  unset.sign_with(key, 0, 1000);  // switched on indoors: its clock begins in 2015
  const auto says = [&](const char* words) {
    const auto why = link.gate.trouble(link.now, false);
    return why.find(words) != std::string::npos && why.find(k_aircraft) != std::string::npos
               ? ::testing::AssertionSuccess()
               : ::testing::AssertionFailure() << why;
  };
  EXPECT_FALSE(link.receive(k_aircraft, plain.pack(heartbeat())));
  EXPECT_TRUE(says("are not signed"));
  EXPECT_FALSE(link.receive(k_aircraft, wrong.pack(heartbeat())));
  EXPECT_TRUE(says("another key"));
  EXPECT_FALSE(link.receive(k_aircraft, unset.pack(heartbeat())));
  EXPECT_TRUE(says("clock is not set"));
  link.now = 6;
  EXPECT_EQ(link.gate.trouble(link.now, false), "") << "it has been silent since";
  unset.set_time(stamp + 600'000);
  EXPECT_TRUE(link.receive(k_aircraft, unset.pack(heartbeat()))) << "GNSS has set its clock";
  EXPECT_FALSE(link.receive(k_stranger, wrong.pack(heartbeat())));
  EXPECT_EQ(link.gate.trouble(link.now, true), "") << "a stranger is no trouble while the aircraft is heard";
}

// MAV_TYPE of MAVLink's minimal.xml; the autopilot is ArduPilot in all of them.
Message of_type(int type) { return heartbeat().set("type", type); }

TEST(PeerGate, OnlyMultirotorsAreFollowed) {
  for (const int type : {2, 3, 4, 13, 14, 15, 29, 35, 43}) {
    Link link;
    Packer one({1, 1});
    EXPECT_TRUE(link.receive(k_aircraft, one.pack(of_type(type)))) << type;
  }
  for (const auto& [type, kind] : {std::pair{1, "fixed wing"},
                                   {5, "antenna tracker"},
                                   {10, "ground vehicle"},
                                   {11, "boat"},
                                   {12, "submarine"},
                                   {7, "other vehicle"},
                                   {0, "other vehicle"},
                                   {20, "VTOL"},
                                   {22, "VTOL"}}) {
    Link link;
    Packer one({7, 1});
    EXPECT_FALSE(link.receive(k_aircraft, one.pack(of_type(type)))) << type;
    EXPECT_FALSE(link.gate.peer()) << type;
    ASSERT_EQ(link.gate.others(0).size(), 1u);
    EXPECT_EQ(link.gate.others(0).front().kind, kind);
    EXPECT_EQ(link.gate.trouble(0, false), "system 7 at " + k_aircraft + " is of kind " + kind +
                                               ": anchord commands multirotors only, it is not followed");
  }
  for (const auto& [type, kind] :
       {std::pair{6, "ground station"}, {26, "gimbal"}, {30, "camera"}, {18, "other"}}) {
    Link link;
    Packer one({1, 154});
    EXPECT_FALSE(link.receive(k_aircraft, one.pack(of_type(type)))) << type;
    EXPECT_EQ(link.gate.others(0).front().kind, kind);
    EXPECT_EQ(link.gate.trouble(0, false), "") << "it stands in for no aircraft: " << kind;
  }
}

TEST(PeerGate, AnAntennaTrackerNeverTakesTheAircraftsPlace) {
  Link link;
  Packer tracker({2, 1}), copter({1, 1});
  EXPECT_FALSE(link.receive("", tracker.pack(of_type(5)))) << "heard first";
  EXPECT_TRUE(link.receive("", copter.pack(heartbeat())));
  EXPECT_EQ(link.gate.vehicle(), (Address{1, 1}));
  for (link.now = 1; link.now < 30; link.now += 1) link.receive("", tracker.pack(of_type(5)));
  EXPECT_EQ(link.gate.vehicle(), (Address{1, 1})) << "its battery is being changed";
  EXPECT_TRUE(link.receive("", copter.pack(heartbeat())));
  EXPECT_EQ(link.gate.vehicle(), (Address{1, 1}));
}

TEST(PeerGate, AnAircraftThatNamesItselfAPlaneIsFollowedNoLonger) {
  Link link;
  Packer one({1, 1}), other({1, 1});
  ASSERT_TRUE(link.receive(k_aircraft, one.pack(heartbeat())));
  link.now = 1;
  link.receive(k_aircraft, one.pack(of_type(1)));
  EXPECT_NE(link.gate.trouble(link.now, true).find("fixed wing"), std::string::npos)
      << link.gate.trouble(link.now, true);
  link.now = 10.5;  // of its last heartbeat as a copter
  link.receive(k_aircraft, one.pack(of_type(1)));
  EXPECT_TRUE(link.receive(k_stranger, other.pack(heartbeat())));
}

TEST(SigningKey, IsHexadecimalOrRawAndItsFileIsTheOwnersAlone) {
  const std::string hex = "000102030405060708090A0B0c0d0e0f101112131415161718191a1b1c1d1e1f";
  const auto key = parse_signing_key(hex + "\n");
  ASSERT_TRUE(key) << key.error().message;
  EXPECT_EQ(key.value()[31], 0x1f);
  EXPECT_TRUE(parse_signing_key(std::string(32, '\xff')));
  EXPECT_FALSE(parse_signing_key("secret"));
  EXPECT_FALSE(parse_signing_key(std::string(64, 'g')));
  const std::string file = testing::TempDir() + "/anchord-signing-key-" + std::to_string(::getpid());
  std::ofstream(file) << hex << '\n';
  ::chmod(file.c_str(), 0644);
  const auto open = read_signing_key(file);
  ASSERT_FALSE(open);
  EXPECT_NE(open.error().message.find("0600"), std::string::npos) << open.error().message;
  EXPECT_EQ(open.error().message.find("0001"), std::string::npos) << "never the key itself";
  ::chmod(file.c_str(), 0600);
  EXPECT_TRUE(read_signing_key(file));
  ::unlink(file.c_str());
  EXPECT_FALSE(read_signing_key(file));
}

}  // namespace
}  // namespace anchord::drone::peer_gate_test
