// Rows as text: the lines below were given by the server while it still made a document of each.
#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "api/wire/rows_json.hpp"
#include "core/base/to_wire.hpp"
#include "tests/core/types/full_rows.hpp"

namespace anchord::api::row_text_test {
namespace {

using Ordered = nlohmann::ordered_json;

const MissionId k_read_mission{parse_uuid("0197a3b0-1111-7222-8333-444455556666").value()};

std::string line(const Range& range, bool with_cir = true, const Ordered& rest = Ordered::object()) {
  std::string out;
  append_range(out, range, 1, with_cir, rest);
  return out;
}
std::string line(const Fix& fix) {
  std::string out;
  append_fix(out, fix, 1);
  return out;
}

Range full_range() {
  Range r = testing::full_range(k_read_mission);
  r.std_noise = 1e-7;
  r.truth = RangeTruth{7.35, true};
  Cir cir;
  cir.first_path_idx = 744.2;
  cir.preamble_count = 1001;
  cir.re_im = {1, -2};
  r.cir = cir;
  return r;
}

const std::string k_head =
    R"({"id":1,"t_us":1777889472123456,"received_us":1777889472143457,)"
    R"("mission":"0197a3b0-1111-7222-8333-444455556666","kind":"tag_anchor","tag":"0x6e01","antenna":2,)"
    R"("anchor":"0xdeadbeef","seq":4000000123,"distance_m":0.30000000000000004,"rss_dbm":-78.25,)"
    R"("fp_dbm":-27.0,"rx_dbm":-79.0,"std_noise":1e-07,"heading_deg":359.99999999,)"
    R"("truth":{"distance_m":7.35,"los":true})";

TEST(RowText, OfARangeIsWhatItWas) {
  const auto range = full_range();
  EXPECT_EQ(line(range, false), k_head + "}");
  EXPECT_EQ(
      line(range, true),
      k_head + R"(,"cir":{"n":1,"dt_ps":1001.6,"first_path_idx":744.2,"rxpacc":1001.0,"b64":"AQD+/w=="}})");
  EXPECT_EQ(line(range, false, {{"predicted", {{"class", "unclear"}, {"p_los", nullptr}}}}),
            k_head + R"(,"predicted":{"class":"unclear","p_los":null}})");
  Range bare;
  bare.mission = k_read_mission;
  bare.kind = RangeKind::anchor_anchor;
  bare.distance_m = 7;
  bare.truth = RangeTruth{};
  EXPECT_EQ(line(bare),
            R"({"id":1,"t_us":0,"mission":"0197a3b0-1111-7222-8333-444455556666","kind":"anchor_anchor",)"
            R"("tag":"0x0000","antenna":0,"anchor":"0x0000","distance_m":7.0,"truth":{}})");
}

TEST(RowText, OfAPositionIsWhatItWas) {
  EXPECT_EQ(line(testing::full_fix(k_read_mission)),
            R"({"id":1,"t_us":1777889472200000,"mission":"0197a3b0-1111-7222-8333-444455556666","seq":7,)"
            R"("lon":11.576124123456,"lat":48.137154321987,"h_m":521.1234,"fix":"fixed",)"
            R"("cov_enu_m2":[0.0001,1e-06,-2e-06,0.00011,3e-06,0.0004],"q":[0.5,-0.5,0.5,0.5],)"
            R"("correction_age_s":0.7,"satellites":21})");
  Fix local;
  local.mission = k_read_mission;
  local.frame = TrackFrame::local;
  local.local_m = {1, -2.5, 0};
  EXPECT_EQ(line(local).substr(0, 116),
            R"({"id":1,"t_us":0,"mission":"0197a3b0-1111-7222-8333-444455556666","local_m":[1.0,-2.5,0.0],)"
            R"("fix":"none"})");
}

TEST(RowText, WritesEveryNumberAsADocumentDoes) {
  std::mt19937_64 random(18);
  std::string text;
  const auto check = [&](double value) {
    text.clear();
    append_number(text, value);
    ASSERT_EQ(text, to_wire(nlohmann::json(value)));
  };
  for (int i = 0; i < 100'000; ++i) check(std::bit_cast<double>(random()));  // NaN and infinities among them
  for (int i = -1000; i < 1000; ++i) check(i / 100.0);
  for (const double value : {0.0, -0.0, 1e15, 1e16, 1e-4, 1e-5, std::numeric_limits<double>::max(),
                             std::numeric_limits<double>::denorm_min()})
    check(value);
}

}  // namespace
}  // namespace anchord::api::row_text_test
