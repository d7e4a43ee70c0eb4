#include "drivers/link/address.hpp"

#include <gtest/gtest.h>

namespace anchord::link::address_test {
namespace {

TEST(LinkAddress, TakesEveryKindAndWritesItBack) {
  for (const char* text :
       {"serial:/dev/serial/by-id/usb-Pozyx_Labs-if00", "serial:/dev/ttyUSB0?baud=57600",
        "tcp://10.0.0.7:9001", "tcp://reach.local:9001", "tcp://[fe80::1]:9001", "tcp-listen://:9002",
        "tcp-listen://0.0.0.0:0", "udp://:14550", "udp://0.0.0.0:14550", "udp://192.168.2.15:14550"}) {
    const auto address = parse_address(text);
    ASSERT_TRUE(address) << text << ": " << address.error().message;
    EXPECT_EQ(to_string(address.value()), text);
  }
  EXPECT_EQ(parse_address("serial:/dev/ttyUSB0").value().baud, 115200);
  EXPECT_EQ(parse_address("serial:/dev/ttyUSB0?baud=115200").value(),
            parse_address("serial:/dev/ttyUSB0").value());
}

TEST(LinkAddress, SaysWhichPartIsWrong) {
  const auto why = [](const char* text) {
    const auto address = parse_address(text);
    return address ? std::string("taken") : address.error().message;
  };
  EXPECT_NE(why("").find("begin with serial:"), std::string::npos);
  EXPECT_NE(why("/dev/ttyUSB0").find("begin with serial:"), std::string::npos);
  EXPECT_NE(why("serial:ttyUSB0").find("absolute path"), std::string::npos);
  EXPECT_NE(why("serial:/dev/ttyUSB0?speed=1").find("?baud="), std::string::npos);
  EXPECT_NE(why("serial:/dev/ttyUSB0?baud=fast").find("baud must be a number"), std::string::npos);
  EXPECT_NE(why("serial:/dev/ttyUSB0?baud=-9600").find("baud must be a number"), std::string::npos);
  EXPECT_NE(why("tcp://host").find("port is missing"), std::string::npos);
  EXPECT_NE(why("tcp://host:0").find("port 0"), std::string::npos);
  EXPECT_NE(why("tcp://host:65536").find("0 to 65535"), std::string::npos);
  EXPECT_NE(why("tcp://:9001").find("host is missing"), std::string::npos);
  EXPECT_NE(why("tcp://fe80::1:9001").find("brackets"), std::string::npos);
  EXPECT_NE(why("tcp://user@host:9001").find("not a host name"), std::string::npos);
}

}  // namespace
}  // namespace anchord::link::address_test
