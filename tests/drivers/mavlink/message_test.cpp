#include "drivers/mavlink/message.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "drivers/mavlink/frame.hpp"

namespace anchord::mavlink::message_test {
namespace {

std::string_view wire_type(FieldType type) {
  switch (type) {
    case FieldType::u8:
      return "uint8_t";
    case FieldType::i8:
      return "int8_t";
    case FieldType::u16:
      return "uint16_t";
    case FieldType::i16:
      return "int16_t";
    case FieldType::u32:
      return "uint32_t";
    case FieldType::i32:
      return "int32_t";
    case FieldType::u64:
      return "uint64_t";
    case FieldType::i64:
      return "int64_t";
    case FieldType::f32:
      return "float";
    case FieldType::text:
      return "char";
  }
  return "";
}

std::uint16_t crc_of(std::string_view text, std::uint16_t crc) {
  return crc_x25({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, crc);
}

// The protocol's own guard against a table that is not its peer's: the sum over names and types of the base
// fields.
TEST(MavlinkTable, CrcExtraFollowsFromNamesAndTypes) {
  for (const auto& info : messages()) {
    auto crc = crc_of(std::string(info.name) + " ", 0xFFFF);
    for (const auto& field : info.fields) {
      if (field.extension) continue;
      crc = crc_of(std::string(wire_type(field.type)) + " " + std::string(field.name) + " ", crc);
      if (field.count > 1) crc = crc_x25(std::array{static_cast<std::uint8_t>(field.count)}, crc);
    }
    EXPECT_EQ(static_cast<std::uint8_t>((crc & 0xFFU) ^ (crc >> 8U)), info.crc_extra) << info.name;
  }
}

TEST(MavlinkTable, BaseFieldsStandInOrderOfTheirSize) {
  for (const auto& info : messages()) {
    std::size_t before = 8;
    for (const auto& field : info.fields) {
      if (field.extension) break;
      EXPECT_LE(size_of(field.type), before) << info.name << "." << field.name;
      before = size_of(field.type);
    }
    EXPECT_LE(info.full_length, 255u);
  }
}

TEST(MavlinkMessage, KeepsEveryFieldOfEveryMessage) {
  for (const auto& info : messages()) {
    Message message(info.name);
    for (const auto& field : info.fields) {
      for (std::size_t i = 0; i < field.count && field.type != FieldType::text; ++i) {
        message.set(field.name, static_cast<std::int64_t>(11 + i), i);
      }
      if (field.type == FieldType::text) message.set_text(field.name, "abc");
    }
    for (const auto& field : info.fields) {
      if (field.type == FieldType::text) {
        EXPECT_EQ(message.text(field.name), "abc");
        continue;
      }
      for (std::size_t i = 0; i < field.count; ++i) {
        EXPECT_EQ(message.integer(field.name, i), static_cast<std::int64_t>(11 + i))
            << info.name << "." << field.name;
      }
    }
  }
}

TEST(MavlinkMessage, SaturatesWhatDoesNotFit) {
  Message message("GLOBAL_POSITION_INT");
  message.set("vx", 1'000'000).set("vy", -1'000'000).set("hdg", -5).set("lat", std::int64_t{1} << 40);
  EXPECT_EQ(message.integer("vx"), 32767);
  EXPECT_EQ(message.integer("vy"), -32768);
  EXPECT_EQ(message.integer("hdg"), 0);
  EXPECT_EQ(message.integer("lat"), std::numeric_limits<std::int32_t>::max());
}

TEST(MavlinkMessage, CutsTextAndReadsAFullFieldWithoutItsZero) {
  Message message("STATUSTEXT");
  message.set_text("text", std::string(60, 'x'));
  EXPECT_EQ(message.text("text"), std::string(50, 'x'));
  message.set_text("text", "short");
  EXPECT_EQ(message.text("text"), "short");
}

TEST(MavlinkMessage, ANameThatIsNotInTheTableIsOurMistake) {
  EXPECT_THROW(Message("NO_SUCH"), std::logic_error);
  EXPECT_THROW(Message("HEARTBEAT").set("speed", 1), std::logic_error);
  EXPECT_THROW((void)Message("HEARTBEAT").integer("type", 1), std::logic_error);
}

}  // namespace
}  // namespace anchord::mavlink::message_test
