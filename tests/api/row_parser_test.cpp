// The fast reader of rows against the one that names errors: what it takes is the same row, and it takes what
// is clean.
#include "api/wire/row_parser.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "api/kit/reader.hpp"
#include "core/base/base64.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api::row_parser_test {
namespace {

using Json = nlohmann::ordered_json;
using Random = std::mt19937_64;

const MissionId k_mission{parse_uuid("0197a3b0-1111-7222-8333-444455556666").value()};

std::size_t below(Random& random, std::size_t n) {
  return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
}

Json pose() {
  return {{"lon", 3.7131},
          {"lat", 51.0231},
          {"h_m", 61.4},
          {"fix", "fixed"},
          {"sigma_m", {0.012, 0.011, 0.021}},
          {"q", {0, 0, 0.6, 0.8}}};
}
Json range_row() {
  return {{"t_us", 1777889472345678},
          {"received_us", 1777889472345999},
          {"seq", 88123},
          {"kind", "tag_anchor"},
          {"tag", "0x6e01"},
          {"antenna", 1},
          {"anchor", "0x6a2f"},
          {"distance_m", 7.412},
          {"rss_dbm", -84.3},
          {"fp_dbm", -86.1},
          {"rx_dbm", -82},
          {"std_noise", 52},
          {"heading_deg", 120.5},
          {"pose", pose()},
          {"truth", {{"distance_m", 7.35}, {"los", true}, {"campaign", "hall-a"}}},
          {"cir",
           {{"n", 3},
            {"dt_ps", 1001.6},
            {"first_path_idx", 744.2},
            {"rxpacc", 1001},
            {"b64", "AAEAAv//AQIDBAUG"}}}};
}
Json fix_row() {
  Json row = pose();
  row["t_us"] = 1777889472345678;
  row["cov_enu_m2"] = {1e-4, 1e-5, 0, 2e-4, 0, 9e-4};
  row["heading_deg"] = 12.5;
  row["correction_age_s"] = 0.8;
  row["satellites"] = 21;
  return row;
}

/// Everything of a row that has a place in it.
std::string whole(const RangeRow& row) {
  return to_wire(range_json(row.range, std::nullopt)) +
         (row.pose ? to_wire(fix_json(*row.pose, std::nullopt)) : "");
}
std::string whole(const Fix& fix) { return to_wire(fix_json(fix, std::nullopt)); }

/// Holds the two readers together; true where the fast one took the row.
template <class Fast, class Slow>
bool agree(const std::string& text, Fast fast, Slow slow) {
  const auto taken = fast(text);
  nlohmann::json value;
  std::vector<FieldError> errors;
  if (auto error = parse_json(text, value)) errors.push_back(*error);
  if (errors.empty()) {
    const auto row = slow(value, errors);
    if (taken && errors.empty()) {
      EXPECT_EQ(whole(*taken), whole(row)) << text;
    }
  }
  if (taken) {
    EXPECT_TRUE(errors.empty()) << text << ": " << errors[0].detail;
  }
  return taken.has_value();
}
bool ranges_agree(RowParser& parser, const std::string& text, const std::optional<MissionId>& mission) {
  return agree(
      text, [&](const std::string& t) { return parser.range(t, mission); },
      [&](const nlohmann::json& value, std::vector<FieldError>& errors) {
        return read_range(value, mission, errors);
      });
}
bool fixes_agree(RowParser& parser, const std::string& text, const std::optional<MissionId>& mission) {
  return agree(
      text, [&](const std::string& t) { return parser.fix(t, mission); },
      [&](const nlohmann::json& value, std::vector<FieldError>& errors) {
        return read_fix(value, mission, errors);
      });
}

/// Values that a field may be wrong with, or just right.
const std::vector<Json>& odd_values() {
  static const std::vector<Json> values{nullptr,
                                        true,
                                        false,
                                        0,
                                        -0.0,
                                        1,
                                        -1,
                                        255,
                                        256,
                                        0.05,
                                        0.049,
                                        150,
                                        150.001,
                                        1e300,
                                        -1e99,
                                        4096,
                                        4097,
                                        "",
                                        " ",
                                        "0x6e01",
                                        "0x",
                                        "6e01",
                                        "fixed",
                                        "Fixed",
                                        "a\"",
                                        "\\",
                                        "\n",
                                        "\x7f",
                                        "\xc3\xa9",
                                        "AAEA",
                                        "AAEAAv//",
                                        "A===",
                                        Json::array(),
                                        {1, 2},
                                        {1, 2, 3},
                                        {0, 0, 0, 1},
                                        {"a", 1, 2},
                                        Json::object(),
                                        9223372036854775807,
                                        18446744073709551615ULL,
                                        "0197a3b0-1111-7222-8333-444455556666",
                                        12.5,
                                        4102444800000001};
  return values;
}

void spoil(Json& row, Random& random) {
  auto it = row.begin();
  for (std::size_t n = below(random, row.size()); n > 0; --n) ++it;
  Json& value = *it;
  if (value.is_object() && !value.empty() && below(random, 2) == 0) return spoil(value, random);
  switch (below(random, 3)) {
    case 0:
      row.erase(it);
      break;
    case 1:
      value = odd_values()[below(random, odd_values().size())];
      break;
    default:
      row["unknown"] = 1;
      break;
  }
}

TEST(RowParser, TakesRowsThatAreAsTheyShouldBe) {
  RowParser parser;
  EXPECT_TRUE(ranges_agree(parser, to_wire(range_row()), k_mission));
  EXPECT_TRUE(ranges_agree(parser, "  " + to_wire(range_row(), 2) + "\r\n", k_mission));
  EXPECT_TRUE(fixes_agree(parser, to_wire(fix_row()), k_mission));
  Json own = fix_row();
  own["mission"] = to_string(k_mission);
  EXPECT_TRUE(fixes_agree(parser, to_wire(own), std::nullopt));
  Json local = fix_row();
  for (const char* key : {"lon", "lat", "h_m"}) local.erase(key);
  local["local_m"] = {1.5, -2, 3};
  EXPECT_TRUE(fixes_agree(parser, to_wire(local), k_mission));
  Json least{{"distance_m", 2}, {"anchor", "0x6a2f"}, {"tag", "0x6e01"}, {"t_us", 1}, {"rss_dbm", nullptr}};
  EXPECT_TRUE(ranges_agree(parser, to_wire(least), k_mission));
  EXPECT_FALSE(ranges_agree(parser, to_wire(least), std::nullopt));
}

TEST(RowParser, ReadsImpulseResponsesOfAnyLength) {
  RowParser parser;
  Random random(3);
  for (const std::size_t taps : {1U, 2U, 128U, 1016U, 4096U}) {
    std::string bytes(taps * 4, '\0');
    for (char& c : bytes) c = static_cast<char>(below(random, 256));
    Json row = range_row();
    row["cir"]["n"] = taps;
    row["cir"]["b64"] = base64(bytes);
    EXPECT_TRUE(ranges_agree(parser, to_wire(row), k_mission)) << taps;
    row["cir"]["n"] = taps + 1;
    EXPECT_FALSE(ranges_agree(parser, to_wire(row), k_mission)) << taps;
  }
}

TEST(RowParser, LeavesWhatIsNotJsonToTheOther) {
  RowParser parser;
  const std::string row = to_wire(range_row());
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("[]"), std::string("1"), row + row, row + " x",
        row + ",", row.substr(0, row.size() - 1), "[" + row + "]", std::string(R"({"t_us":1,"t_us":1})"),
        std::string(R"({"t_us":01})"), std::string(R"({"t_us":1 "seq":2})"), std::string(R"({"t_us":1,})"),
        std::string("{\"tag\":\"\xff\"}"), std::string(R"({"t_\u0075s":1})")})
    EXPECT_FALSE(ranges_agree(parser, text, k_mission)) << text;
}

TEST(RowParser, AgreesOnRowsSpoiltInTheirValues) {
  RowParser parser;
  Random random(1);
  std::size_t taken = 0;
  for (int k = 0; k < 40'000; ++k) {
    Json row = k % 2 == 0 ? range_row() : fix_row();
    for (std::size_t n = below(random, 4); n > 0 && !row.empty(); --n) spoil(row, random);
    const auto mission = below(random, 5) == 0 ? std::nullopt : std::optional(k_mission);
    const std::string text = to_wire(row);
    taken += (k % 2 == 0 ? ranges_agree(parser, text, mission) : fixes_agree(parser, text, mission)) ? 1 : 0;
  }
  EXPECT_GT(taken, 8'000U);
  EXPECT_LT(taken, 32'000U);
}

TEST(RowParser, AgreesOnRowsSpoiltInTheirBytes) {
  RowParser parser;
  Random random(2);
  const std::string clean[] = {to_wire(range_row()), to_wire(fix_row())};
  constexpr std::string_view odd = "{}[]\",:\\0e-+.9tnf \t\x01\x7f\x80\xc3";
  for (int k = 0; k < 40'000; ++k) {
    std::string text = clean[k % 2];
    for (std::size_t n = 1 + below(random, 3); n > 0; --n) {
      const std::size_t at = below(random, text.size());
      switch (below(random, 3)) {
        case 0:
          text[at] = odd[below(random, odd.size())];
          break;
        case 1:
          text.erase(at, 1 + below(random, 5));
          break;
        default:
          text.insert(at, 1, odd[below(random, odd.size())]);
          break;
      }
    }
    (void)(k % 2 == 0 ? ranges_agree(parser, text, k_mission) : fixes_agree(parser, text, k_mission));
  }
}

}  // namespace
}  // namespace anchord::api::row_parser_test
