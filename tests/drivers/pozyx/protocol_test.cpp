#include "drivers/pozyx/protocol.hpp"

#include <gtest/gtest.h>

#include "drivers/pozyx/registers.hpp"
#include "tests/drivers/pozyx/transcript.hpp"

namespace anchord::pozyx::protocol_test {
namespace {

class Transcripts : public testing::TestWithParam<const char*> {};

TEST_P(Transcripts, AreReadAndWrittenAsTheyStand) {
  const auto exchanges = transcript(GetParam());
  ASSERT_GT(exchanges.size(), 7u);
  for (const Exchange& exchange : exchanges) {
    const auto command = parse_command(exchange.question);
    ASSERT_TRUE(command) << exchange.question;
    const Command& c = command.value();
    std::string again;
    switch (c.kind) {
      case Command::Kind::read:
        again = read_line(c.address, c.count);
        break;
      case Command::Kind::write:
        again = write_line(c.address, c.data);
        break;
      case Command::Kind::function:
        again = function_line(c.address, c.data, c.count);
        break;
    }
    if (exchange.question != "R,1A,2" && exchange.question != "F,C3,,1") {
      EXPECT_EQ(again, exchange.question + "\r");
    }
    EXPECT_EQ(c.kind == Command::Kind::write, exchange.answer.empty()) << exchange.question;
    if (exchange.answer.empty()) continue;
    const auto reply = parse_reply(exchange.answer, c.count);
    ASSERT_TRUE(reply) << exchange.question << " " << exchange.answer;
    EXPECT_EQ(reply_line(reply.value()), "D," + exchange.answer.substr(2) + "\r\n");
  }
}
INSTANTIATE_TEST_SUITE_P(Pozyx, Transcripts, testing::Values("local.txt", "remote.txt", "client.txt"));

TEST(PozyxReply, OfAnotherQuestionIsNotTaken) {
  EXPECT_TRUE(parse_reply("D,43", 1));
  EXPECT_TRUE(parse_reply("D,", 0));
  for (const char* line : {"D,4313", "D,4", "D,4g", "d,43", "E,43", "43", "", "D", "R,00,1", "D,43 "}) {
    EXPECT_FALSE(parse_reply(line, 1)) << line;
  }
}

TEST(PozyxCommand, OfNoiseIsRefused) {
  for (const char* line :
       {"", "R", "R,", "R,00", "R,00,", "R,00,x", "R,0g,1", "R,000,1", "R,00,256", "R,00,-1", "X,00,1",
        "W,00", "W,1c,0", "W,1c,zz", "F,b5,0160", "F,b5,016,1", "RR,00,1", "F,b5,0160,1,"}) {
    EXPECT_FALSE(parse_command(line)) << line;
  }
}

TEST(PozyxChunks, AreOf28Bytes) {
  const auto block = chunks(0x50, 49);
  ASSERT_EQ(block.size(), 2u);
  EXPECT_EQ(block[1].address, 0x6c);
  EXPECT_EQ(block[1].offset, 28u);
  EXPECT_EQ(block[1].size, 21u);
  EXPECT_EQ(chunks(0x50, 28).size(), 1u);
  EXPECT_TRUE(chunks(0x50, 0).empty());
}

TEST(PozyxLines, AreTheSameHoweverTheStreamIsCutAndNoiseCannotMakeThemGrow) {
  const std::string stream = "D,43\r\n\r\nD,00\r\n" + std::string(5000, 'x') + "\r\nD,10\r\n";
  for (const std::size_t piece : {std::size_t{1}, std::size_t{3}, stream.size()}) {
    Lines lines;
    std::vector<std::string> out;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      lines.feed(std::string_view(stream).substr(at, piece));
      while (const auto line = lines.next()) out.push_back(*line);
    }
    EXPECT_EQ(out, (std::vector<std::string>{"D,43", "D,00", "D,10"})) << piece;
    EXPECT_EQ(lines.dropped_bytes(), 5000u) << piece;
  }
}

TEST(PozyxRegisters, DoNotOverlapAndFillTheSensorBlock) {
  int last = -1, sensor_bytes = 0;
  for (const Register& row : k_registers) {
    EXPECT_GT(row.address, last) << row.name;
    last = row.address + row.bytes - 1;
    if (row.address >= 0x50 && row.address <= 0x80) sensor_bytes += row.bytes;
  }
  EXPECT_EQ(sensor_bytes, 49);  // section 8
  EXPECT_EQ(register_at(0x68)->name, "EULER");
  EXPECT_EQ(register_at(0x07), nullptr);
  EXPECT_EQ(error_text(0x12), "no answer to ranging (first frame)");
  EXPECT_EQ(error_text(0x55), "unknown");
}

}  // namespace
}  // namespace anchord::pozyx::protocol_test
