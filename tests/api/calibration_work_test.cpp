// A calibration as work for another process: the same record as without, and answers of a stranger.
#include "api/calibration/calibration_work.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "api/calibration/calibration_json.hpp"
#include "api/work/packed_text.hpp"
#include "core/base/to_wire.hpp"
#include "tests/core/localize/flight_support.hpp"

#include <nlohmann/json.hpp>

namespace anchord::api::calibration_work_test {
namespace {

using anchord::testing::MadeFlight;
using ::testing::HasSubstr;

/// One of each, so that a test can move either.
struct Both {
  CalibrationTask task;
  CalibrationOrder order;

  void add(const MadeFlight& made, const std::string& name, const std::string& kit) {
    FlightData flight = anchord::testing::make_flight(made);
    flight.mission.id.uuid.bytes[0] = static_cast<std::uint8_t>(task.flights.size() + 1);
    flight.mission.name = name;
    flight.mission.kit = kit;
    flight.mission.lever_arm_sigma_m = 0.02;
    flight.keep_rows();
    CalibrationOrder::Flight ordered;
    ordered.id = flight.mission.id;
    ordered.name = name;
    ordered.kit = kit;
    ordered.exclusions_json = exclusions_json({});
    ordered.n_fixes = flight.fixes.size();
    ordered.n_ranges = flight.rows.size();
    for (const auto& row : flight.rows) {
      ordered.anchors.push_back(row.anchor);
      if (row.kind == RangeKind::anchor_anchor) ordered.anchors.push_back(row.tag);
    }
    std::ranges::sort(ordered.anchors);
    const auto rest = std::ranges::unique(ordered.anchors);
    ordered.anchors.erase(rest.begin(), rest.end());
    order.flights.push_back(std::move(ordered));
    order.frame = made.frame;
    if (made.frame == TrackFrame::wgs84) order.origin = task.options.origin = made.origin;
    task.flights.push_back(std::move(flight));
    order.n_answered = task.n_answered = task.flights.size();
    if (std::ranges::find(task.kits, kit, &CalibrationTask::Kit::name) == task.kits.end()) {
      task.kits.push_back({kit});
      if (!kit.empty()) order.kits.push_back({kit});
    }
    order.teaches = teaches(task.options);
    order.floor_sigma_m = task.options.floor_sigma_m;
    order.settings_json = "{}";
  }
};

/// All that is kept of it.
std::string kept(const CalibrationOrder& order, CalibrationAnswer answer) {
  const auto made = record_of(order, std::move(answer)).value();
  return to_wire(calibration_json(made, nullptr)) + made.provenance.text + made.evidence.text;
}

std::string taught(const CalibrationAnswer& answer) {
  std::string out;
  for (const auto& profile : answer.learned) {
    out += profile.kit;
    for (const auto& factor : profile.factors) {
      out += factor.flight + factor.digest;
      for (const double v : factor.information.reshaped()) out += std::to_string(v) + ' ';
    }
  }
  return out;
}

/// Here, and by way of messages.
void expect_same(const Both& both, bool solvable = true) {
  CalibrationTask task = both.task;
  auto here = solve_calibration(task, [](double, const std::string&) {});
  const auto message = calibration_message(both.task);
  ASSERT_TRUE(is_calibration_work(message));
  const auto text = do_calibration_work(message, {}, {});
  ASSERT_EQ(here.has_value(), solvable);
  ASSERT_EQ(text.has_value(), solvable);
  if (!here) {
    EXPECT_EQ(here.error().message, text.error().message);
    return;
  }
  const auto there = read_answer(both.order, text.value());
  ASSERT_TRUE(there) << there.error().message;
  EXPECT_EQ(taught(there.value()), taught(here.value()));
  EXPECT_EQ(kept(both.order, there.value()), kept(both.order, here.value()));
}

MadeFlight on_the_globe(std::uint64_t seed) {
  MadeFlight made = anchord::testing::turning(seed);
  made.frame = TrackFrame::wgs84;
  made.bias_m = 0.3;
  made.nlos_share = 0.1;
  return made;
}

TEST(CalibrationWork, GivesTheSameRecordAsWithoutMessages) {
  Both both;
  both.add(on_the_globe(1), "first", "kit");
  expect_same(both);
}

TEST(CalibrationWork, GivesTheSameRecordOfFlightsInLocalMetresThatShareAKitAndHearEachOther) {
  Both both;
  MadeFlight made = anchord::testing::turning(2);
  made.pairs = true;
  both.add(made, "first", "kit");
  made.seed = 3;
  both.add(made, "second \xc3\xa9", "kit");
  made.seed = 4;
  both.add(made, "of no kit", "");
  both.order.n_answered = both.task.n_answered = 2;  // the third only tells
  both.order.iterations = both.task.iterations = 6;
  both.task.flights[0].n_ranges_excluded[NetworkId{0x6000}] = 4;
  both.task.flights[0].n_fixes_excluded = 2;
  both.task.flights[1].notes = {"a note"};
  expect_same(both);
}

TEST(CalibrationWork, GivesTheSameRecordWhereThePositionsAreDoubtful) {
  for (const double width_m : {15.0, 0.2}) {
    Both both;
    MadeFlight flat = on_the_globe(5);
    flat.height_swing_m = 0;
    flat.width_m = width_m;
    flat.duration_s = 20;
    both.add(flat, "flat", "kit");
    expect_same(both);
  }
}

TEST(CalibrationWork, GivesTheSameRecordOfRangesThatModelsCorrected) {
  Both both;
  both.add(on_the_globe(6), "corrected", "kit");
  auto& flight = both.task.flights[0];
  FlightModelsReport report;
  report.n_ranges = flight.rows.size();
  report.n_los = 7;
  for (std::size_t i = 0; i < flight.rows.size(); ++i) {
    flight.received_m.push_back(flight.rows[i].distance_m);
    flight.error_models.emplace_back();
    if (i % 3 == 0) continue;
    flight.rows[i].distance_m -= 0.05;
    flight.error_models.back() = RangeErrorModel{.p_los = 0.4 + 0.1 * static_cast<double>(i % 5)};
    ++report.n_corrected;
    ++report.n_believed;
  }
  report.mean_correction_m = 0.05;
  both.task.models = both.order.reports = {report};
  expect_same(both);
}

TEST(CalibrationWork, SaysOfAFlightThatCannotBeSolvedWhatItSaysHere) {
  Both both;
  both.add(on_the_globe(7), "empty", "kit");
  both.task.flights[0].rows.clear();
  expect_same(both, false);
}

/// A flight of which answers are sent that were tampered with.
class StrangeAnswer : public ::testing::Test {
 protected:
  static const Both& asked() {
    static const Both both = [] {
      Both made;
      made.add(on_the_globe(8), "asked", "kit");
      return made;
    }();
    return both;
  }
  static CalibrationAnswer good() {
    static const CalibrationAnswer answer = [] {
      CalibrationTask task = asked().task;
      return solve_calibration(task, [](double, const std::string&) {}).value();
    }();
    return answer;
  }
  static std::string refusal(const CalibrationAnswer& answer) {
    const auto read = read_answer(asked().order, answer_text(answer));
    return read ? "" : read.error().message;
  }
};

TEST_F(StrangeAnswer, IsTakenAsItWasMade) { EXPECT_EQ(refusal(good()), ""); }

TEST_F(StrangeAnswer, IsRefusedWithAnAnchorThatNoRangeNames) {
  auto answer = good();
  answer.flights[0].anchors.back().estimate.anchor = NetworkId{0xbeef};
  EXPECT_THAT(refusal(answer), HasSubstr("anchor 0xbeef: no range of the flight names it"));
  answer = good();
  answer.flights[0].anchors.push_back(answer.flights[0].anchors.back());
  EXPECT_THAT(refusal(answer), HasSubstr("not in order of their ids"));
  answer = good();
  answer.flights[0].evidence.residuals[NetworkId{0xbeef}] = {};
  EXPECT_THAT(refusal(answer), HasSubstr("residuals of 0xbeef"));
  answer = good();
  answer.course[NetworkId{0xbeef}] = {};
  EXPECT_THAT(refusal(answer), HasSubstr("the course of 0xbeef"));
}

TEST_F(StrangeAnswer, IsRefusedWithNumbersThatAreNone) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    auto answer = good();
    answer.flights[0].anchors[1].estimate.best->position.m.y() = bad;
    EXPECT_THAT(refusal(answer), HasSubstr("estimate of 0x6001: a number is not finite"));
    answer = good();
    answer.flights[0].anchors[1].estimate.gates[0].limit = bad;
    EXPECT_THAT(refusal(answer), HasSubstr("a number is not finite"));
    answer = good();
    answer.learned.at(0).factors.at(0).information(0, 0) = bad;
    EXPECT_THAT(refusal(answer), HasSubstr("profiles of kits: a number is not finite"));
  }
  auto answer = good();
  answer.flights[0].anchors[0].estimate.best->position.m.x() = 1e300;
  EXPECT_THAT(refusal(answer), HasSubstr("more than a million km away"));
  answer = good();
  answer.flights[0].anchors[0].estimate.best->covariance_m2(0, 1) += 1;
  EXPECT_THAT(refusal(answer), HasSubstr("a covariance is none"));
}

TEST_F(StrangeAnswer, IsRefusedWithMoreThanCanBe) {
  auto answer = good();
  answer.flights.push_back(answer.flights[0]);
  EXPECT_THAT(refusal(answer), HasSubstr("2 flights, and 1 were asked"));
  answer = good();
  answer.flights[0].copy_of = 0;
  EXPECT_THAT(refusal(answer), HasSubstr("is a copy of one that does not count"));
  answer = good();
  answer.flights[0].evidence.residuals.begin()->second.resize(501);
  EXPECT_THAT(refusal(answer), HasSubstr("501 of them, and at most 500"));
  answer = good();
  answer.flights[0].anchors[0].estimate.n_used = 1'000'000;
  EXPECT_THAT(refusal(answer), HasSubstr("more ranges than the flight has"));
  // A bomb: little text, very many bytes.
  const auto bomb =
      read_answer(asked().order, packed_text(std::string(answer_bytes(asked().order) + 1, '\0')));
  ASSERT_FALSE(bomb);
  EXPECT_THAT(bomb.error().message, HasSubstr("more than"));
}

TEST_F(StrangeAnswer, IsRefusedWhereItTeachesWhatWasNotAsked) {
  auto answer = good();
  answer.learned.at(0).kit = "another";
  EXPECT_THAT(refusal(answer), HasSubstr("kit \"another\", which no flight names"));
  answer = good();
  answer.learned.at(0).factors.at(0).information(0, 1) += 1e9;
  EXPECT_THAT(refusal(answer), HasSubstr("not symmetric"));
  answer = good();
  answer.models.emplace_back();
  EXPECT_THAT(refusal(answer), HasSubstr("models of other flights"));
}

TEST_F(StrangeAnswer, IsRefusedWhereverItIsCut) {
  const auto bytes = from_packed_text(answer_text(good()), std::size_t{1} << 30).value();
  for (std::size_t n = 0; n < bytes.size(); n += n < 600 ? 1 : 4999)
    EXPECT_FALSE(read_answer(asked().order, packed_text(std::string_view(bytes).substr(0, n)))) << n;
  EXPECT_FALSE(read_answer(asked().order, packed_text(bytes + "x")));
  EXPECT_FALSE(read_answer(asked().order, "no base64"));
  EXPECT_FALSE(read_answer(asked().order, ""));
}

TEST(CalibrationOrderText, ComesBackAsItWas) {
  Both both;
  both.add(on_the_globe(9), "kept", "kit");
  both.order.local_frame = LocalFrame{};
  both.order.models["bias"] = ModelId{};
  const auto text = order_text(both.order);
  const auto again = read_order(text);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(order_text(again.value()), text);
}

TEST(CalibrationMessage, OfAnHourIsWithinItsLimit) {
  Both both;
  MadeFlight made = on_the_globe(10);
  made.duration_s = 3600;
  both.add(made, "long", "kit");
  const auto message = calibration_message(both.task);
  const auto n = both.task.flights[0].rows.size();
  std::printf("%zu ranges and %zu positions are %.2f MB of text\n", n, both.task.flights[0].fixes.size(),
              static_cast<double>(message.size()) * 1e-6);
  EXPECT_LT(message.size(), k_most_message_bytes);
}

}  // namespace
}  // namespace anchord::api::calibration_work_test
