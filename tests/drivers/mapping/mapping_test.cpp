#include "drivers/mapping/mapping.hpp"

#include <gtest/gtest.h>

namespace anchord::mapping::mapping_test {
namespace {

std::string why(const std::string& json) {
  const auto mapping = parse_mapping(json);
  return mapping ? "" : mapping.error().message;
}

constexpr const char* k_least = R"({"tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"mm"}})";

TEST(Mapping, NeedsTagAnchorAndDistanceWithItsUnit) {
  EXPECT_EQ(why(k_least), "");
  EXPECT_EQ(why("{}"),
            "mapping/tag: is needed, like \"/tag\"; mapping/anchor: is needed, like \"/anchor\"; "
            "mapping/distance: is needed, like {\"pointer\": \"/distance\", \"unit\": \"mm\"}");
  EXPECT_EQ(why("[]"), "mapping: must be a JSON object");
  EXPECT_EQ(why("{"), "mapping: must be a JSON object");
}

TEST(Mapping, NamesEveryFaultWithItsPlaceAndWhatWouldBeRight) {
  const auto all =
      why(R"({"tag":"t","anchor":{"pointer":"/a","value":"1"},"distance":{"pointer":"/d","unit":"furlong"},
    "time":{"pointer":"/t","unit":"h","clock":"sun"},"rssi":"/r","id_format":"roman","rss":{"pointer":"/r","scale":0},
    "array":{"pointer":"/x"},"topic":"a/#/b","ids":{"kitchen":"red"}})");
  for (const char* one : {"mapping/rssi: there is no such key; the keys are topic, array,",
                          "mapping/tag: \"t\" is not a JSON pointer: write \"/tag/id\" for the element, "
                          "\"#/tag\" for the whole message",
                          "mapping/anchor: needs one of pointer, topic_level, value",
                          "mapping/distance/unit: must be one of m, cm, mm, ft",
                          "mapping/time/unit: must be one of s, ms, us, ns, rfc3339",
                          "mapping/time/clock: must be utc (Unix time) or device (since it was switched on)",
                          "mapping/id_format: must be one of any, decimal, hex",
                          "mapping/rss/scale: must be a number other than 0",
                          "mapping/array: must be a JSON pointer; \"\" means the whole message",
                          "mapping/topic: '#' must be the whole last level",
                          "mapping/ids/kitchen: must be an id like \"0x6a2f\""})
    EXPECT_NE(all.find(one), std::string::npos) << one << "\n in " << all;
}

TEST(Mapping, TakesNothingOfAnotherType) {
  for (const char* value : {"1", "true", "null", "[]", "{}", "[1]", "\"\\u0000\"", "1e400"}) {
    for (const char* key : {"topic", "array", "tag", "anchor", "id_format", "id_prefix", "distance", "time",
                            "rss", "first_path", "received_power", "seq"}) {
      std::string json = k_least;
      json.pop_back();
      const std::string name = '"' + std::string(key) + '"';
      if (const auto at = json.find(name); at != std::string::npos) json.replace(at, name.size(), "\"ids\"");
      EXPECT_NE(why(json + ',' + name + ':' + value + '}'), "") << key << ' ' << value;
    }
  }
}

// MQTT 3.1.1 section 4.7.1: examples of valid and invalid filters.
TEST(Mapping, TakesTopicFiltersAsTheStandardHasThem) {
  for (const char* good : {"#", "sport/tennis/#", "+", "+/tennis/#", "sport/+/player1", "/finance", "a//b"})
    EXPECT_EQ(wrong_filter(good), "") << good;
  for (const char* bad : {"", "sport/tennis#", "sport/tennis/#/ranking", "sport+"})
    EXPECT_NE(wrong_filter(bad), "") << bad;
  EXPECT_NE(wrong_filter(std::string_view("a\0b", 3)), "");
  EXPECT_NE(wrong_filter("\xff"), "");
}

TEST(Mapping, ReadsIdsInTheFormTheyHave) {
  Mapping mapping;
  EXPECT_EQ(id_of(mapping, "27183"), NetworkId{0x6a2f});
  EXPECT_EQ(id_of(mapping, "0x6a2f"), NetworkId{0x6a2f});
  for (const char* bad : {"", "6a2f", "-1", "4294967296", "1.5", "kitchen"})
    EXPECT_FALSE(id_of(mapping, bad)) << bad;
  mapping.id_format = IdFormat::decimal;
  EXPECT_FALSE(id_of(mapping, "0x6a2f"));
  mapping.id_format = IdFormat::hex;
  EXPECT_EQ(id_of(mapping, "6A2F"), NetworkId{0x6a2f});
  EXPECT_EQ(id_of(mapping, "10"), NetworkId{0x10});
  EXPECT_EQ(id_of(mapping, "DE:CA:51:A0:D0:C1:08:2F"), NetworkId{0xd0c1082f}) << "the end of an EUI-64";
  for (const char* bad : {"", "0x", "DECA51A0D0C1082F0", "g"}) EXPECT_FALSE(id_of(mapping, bad)) << bad;
  mapping.id_prefix = "tag-";
  mapping.ids["kitchen"] = {7};
  EXPECT_EQ(id_of(mapping, "tag-6a2f"), NetworkId{0x6a2f});
  EXPECT_FALSE(id_of(mapping, "6a2f"));
  EXPECT_EQ(id_of(mapping, "kitchen"), NetworkId{7});
}

}  // namespace
}  // namespace anchord::mapping::mapping_test
