#include "drivers/mqtt/packet.hpp"

#include <gtest/gtest.h>

#include <random>

namespace anchord::mqtt::packet_test {
namespace {

using namespace std::string_literals;
using namespace std::string_view_literals;

/// Type, flags and body of each packet; '-' for one that was skipped; why it ended.
std::string read(PacketReader& reader, std::string_view bytes) {
  std::string out;
  const auto done = reader.take(
      bytes,
      [&](const Packet& p) {
        out += std::to_string(static_cast<int>(p.type)) + '.' + std::to_string(p.flags) + ':' +
               std::string(p.body) + ' ';
      },
      [&] { out += "- "; });
  return done ? out : out + '!' + done.error().message;
}

// Section 3.1.2.11, figure 3.6, and table 2.4 of MQTT 3.1.1.
TEST(MqttPacket, IsWrittenAsTheStandardHasIt) {
  EXPECT_EQ(connect_packet({"a", "", std::nullopt, 10}),
            "\x10\x0d\0\x04MQTT\x04\x02\0\x0a\0\x01"
            "a"s);
  EXPECT_EQ(connect_packet({"a", "u", "pw", 10}),
            "\x10\x14\0\x04MQTT\x04\xc2\0\x0a\0\x01"
            "a\0\x01u\0\x02pw"s);
  EXPECT_EQ(connect_packet({"a", "u", std::nullopt, 10}),
            "\x10\x10\0\x04MQTT\x04\x82\0\x0a\0\x01"
            "a\0\x01u"s);
  EXPECT_EQ(subscribe_packet(10, "a/b"),
            "\x82\x08\0\x0a\0\x03"
            "a/b\0"s);
  EXPECT_EQ(puback_packet(258), "\x40\x02\x01\x02"s);
  EXPECT_EQ(ping_packet(), "\xc0\0"s);
  EXPECT_EQ(subscribe_packet(1, std::string(321 - 5, 'x')).substr(0, 3), "\x82\xc1\x02"s)
      << "321: section 2.2.3";
}

TEST(MqttPacket, IsFoundInAnyCut) {
  const std::string stream =
      "\x20\x02\0\0\x30\x05\0\x01tHi\xd0\0\x30\xc8\x01\0\x01t"s + std::string(197, 'x') + "\xd0\0"s;
  PacketReader whole(1000);
  const auto expected = read(whole, stream);
  EXPECT_EQ(expected, "2.0:\0\0 3.0:\0\x01tHi 13.0: 3.0:\0\x01t"s + std::string(197, 'x') + " 13.0: ");
  PacketReader cut(1000);
  std::string got;
  for (const char c : stream) got += read(cut, {&c, 1});
  EXPECT_EQ(got, expected);
}

TEST(MqttPacket, ThatIsTooLargeIsSkippedWithoutBeingHeld) {
  PacketReader reader(100);
  // 10 MB: 0x80 0xad 0xe2 0x04 by the rule of section 2.2.3.
  std::string got = read(reader, "\x30\x80\xad\xe2\x04"s);
  for (int i = 0; i < 10'000; ++i) got += read(reader, std::string(1000, 'x'));
  EXPECT_EQ(got + read(reader, "\xd0\0"s), "- 13.0: ");
  EXPECT_EQ(read(reader, "\x20\x65"s), "!a packet of 101 bytes that is not a message");
}

TEST(MqttPacket, WithALengthOfFiveBytesEndsTheConnection) {
  PacketReader reader(100);
  EXPECT_EQ(read(reader, "\x30\xff\xff\xff\xff\x7f"s), "!a length of more than four bytes: this is not MQTT");
  reader.clear();
  EXPECT_EQ(read(reader, "\xd0\0"s), "13.0: ");
}

TEST(MqttMessage, HasTopicPayloadAndFlagsOrIsRefused) {
  const auto of = [](std::uint8_t flags, std::string_view body) {
    return message_of({PacketType::publish, flags, body});
  };
  const auto plain = of(0,
                        "\0\x03"
                        "a/bxyz"sv);
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain.value().topic, "a/b");
  EXPECT_EQ(plain.value().payload, "xyz");
  EXPECT_FALSE(plain.value().retained);
  const auto kept = of(3,
                       "\0\x01"
                       "a\x01\x02"sv);
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept.value().qos, 1);
  EXPECT_EQ(kept.value().id, 258);
  EXPECT_TRUE(kept.value().retained);
  EXPECT_EQ(kept.value().payload, "");
  for (const auto body : {""sv, "\0"sv, "\0\0x"sv,
                          "\0\x02"
                          "a"sv,
                          "\xff\xff"
                          "a"sv})
    EXPECT_FALSE(of(0, body));
  EXPECT_FALSE(of(2,
                  "\0\x01"
                  "a\x01"sv))
      << "without its number";
  EXPECT_FALSE(of(6,
                  "\0\x01"
                  "axx"sv))
      << "QoS 3";
}

TEST(MqttPacket, BearsAnyBytes) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 2000; ++round) {
    PacketReader reader(500);
    for (int part = 0; part < 5; ++part) {
      std::string bytes(random() % 300, '\0');
      for (char& c : bytes) c = static_cast<char>(random() % 4 == 0 ? random() % 4 : random());
      const auto done = reader.take(
          bytes, [](const Packet& p) { (void)message_of(p).has_value(); }, [] {});
      if (!done) break;
    }
  }
}

}  // namespace
}  // namespace anchord::mqtt::packet_test
