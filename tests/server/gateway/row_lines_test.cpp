// What the outbox writes is read by the server's own parser: the row must come back as it was.
#include "server/gateway/row_lines.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "api/measurements/row_source.hpp"
#include "api/wire/rows_json.hpp"
#include "tests/core/types/full_rows.hpp"

namespace anchord::gateway::row_lines_test {
namespace {

using Json = nlohmann::json;

const MissionId k_flight{parse_uuid("01890a5d-ac96-774b-bcce-b302099a8057").value()};

Range full_range() { return testing::full_range(k_flight); }
Fix full_fix() { return testing::full_fix(k_flight); }

/// The rows of a CSV batch as the server reads them.
template <class Read>
std::vector<Json> read_back(const Batch& batch, api::RowKind kind, Read read) {
  std::vector<api::FieldError> errors;
  auto header = header_of(batch.lines);
  header.remove_suffix(1);
  const api::CsvRows rows(kind, header, errors);
  std::vector<Json> out;
  std::string_view body = batch.body;
  while (!body.empty()) {
    Json value;
    rows.row(body.substr(0, body.find('\n')), value, errors);
    body.remove_prefix(body.find('\n') + 1);
    out.push_back(read(value, errors));
  }
  for (const auto& e : errors) ADD_FAILURE() << e.pointer << " " << e.code << " " << e.detail;
  return out;
}

TEST(GatewayRows, RangesComeBackFromCsvAsTheyWere) {
  Range bare;
  bare.mission = k_flight;
  bare.time = UtcTime::from_us(1'777'889'472'000'001);
  bare.tag = {0x6e02};
  bare.anchor = {0x6a2f};
  bare.kind = RangeKind::anchor_anchor;
  bare.distance_m = 7.5;
  const auto batches = batches_of({{}, {full_range(), bare}});
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].lines, Lines::ranges_csv);
  EXPECT_EQ(batches[0].n_rows, 2u);
  EXPECT_EQ(batches[0].newest.us(), 1'777'889'472'123'456);
  const auto rows = read_back(batches[0], api::RowKind::range, [](const Json& json, auto& errors) {
    return Json(api::range_json(api::read_range(json, k_flight, errors).range, std::nullopt));
  });
  EXPECT_EQ(rows.at(0), Json(api::range_json(full_range(), std::nullopt)));
  EXPECT_EQ(rows.at(1), Json(api::range_json(bare, std::nullopt)));
}

TEST(GatewayRows, FixesComeBackFromCsvAsTheyWereOnTheGlobeAndInALocalFrame) {
  Fix local;
  local.mission = k_flight;
  local.time = UtcTime::from_us(1'777'889'472'300'000);
  local.frame = TrackFrame::local;
  local.local_m = {1.25, -0.1, 3};
  local.fix = FixClass::rtk_fixed;
  const auto batches = batches_of({{full_fix(), local}, {}});
  ASSERT_EQ(batches.size(), 1u);
  const auto rows = read_back(batches[0], api::RowKind::fix, [](const Json& json, auto& errors) {
    return Json(api::fix_json(api::read_fix(json, k_flight, errors), std::nullopt));
  });
  EXPECT_EQ(rows.at(0), Json(api::fix_json(full_fix(), std::nullopt)));
  EXPECT_EQ(rows.at(1), Json(api::fix_json(local, std::nullopt)));
}

TEST(GatewayRows, RangesWithAnImpulseResponseAreJson) {
  Range with = full_range();
  with.cir = Cir{{1, -2, 3, -4}, 1001.6, 1.5, 100.0};
  const auto batches = batches_of({{full_fix()}, {full_range(), with}});
  ASSERT_EQ(batches.size(), 3u);
  EXPECT_EQ(batches[0].lines, Lines::fixes_csv);
  EXPECT_EQ(batches[2].lines, Lines::ranges_ndjson);
  std::vector<api::FieldError> errors;
  const auto back = api::read_range(Json::parse(batches[2].body), std::nullopt, errors);
  ASSERT_TRUE(errors.empty());
  EXPECT_EQ(back.range.cir->re_im, with.cir->re_im);
  EXPECT_EQ(back.range.mission, k_flight);
}

}  // namespace
}  // namespace anchord::gateway::row_lines_test
