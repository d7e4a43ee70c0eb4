// One home of a live mission: the same rows give the same events byte for byte, however often, and what is
// told is told once.
#include "core/flight/live_mission.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <set>

#include "core/localize/flight_solver.hpp"
#include "core/types/live_limits.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::live_mission_test {
namespace {

using flight::Event;
using flight::LiveMission;
using testing::MadeFlight;
using testing::make_flight;

/// Every number to its last bit.
struct Dump {
  std::string out;
  void number(double value) {
    char text[40];
    std::snprintf(text, sizeof text, " %a", value);
    out += text;
  }
  void vector(const Eigen::Vector3d& v) {
    for (const double x : {v.x(), v.y(), v.z()}) number(x);
  }
  void estimate(const Estimate& e) {
    out += ' ' + to_string(e.anchor) + ' ' + std::to_string(e.time.ns) + ' ' + std::to_string(e.n_used) +
           ' ' + std::to_string(static_cast<int>(e.verdict)) + ' ' + e.reason;
    for (const auto* at : {&e.best, &e.mirror}) {
      out += *at ? " at" : " nowhere";
      if (!*at) continue;
      vector((*at)->position.m);
      number((*at)->probability);
      for (int i = 0; i < 9; ++i) number((*at)->covariance_m2(i / 3, i % 3));
    }
    number(e.h95_m);
    number(e.v95_m);
    for (const auto& gate : e.gates) {
      out += ' ' + gate.name + (gate.passed ? "+" : "-");
      number(gate.value.value_or(-1));
    }
    for (const auto& [why, n] : e.refused) out += ' ' + why + '=' + std::to_string(n);
  }
  void event(const Event& event) {
    out += std::to_string(event.index());
    std::visit([this](const auto& one) { fields(one); }, event);
    out += '\n';
  }
  void fields(const flight::RangeDecided& e) {
    const auto& r = e.result;
    out += ' ' + std::to_string(r.range.time.ns) + ' ' + to_string(r.range.anchor) + ' ' + r.refused;
    for (const auto& value : {r.residual_m, r.sigma_m, r.corrected_m}) number(value.value_or(-1));
    if (r.tag_enu_m) vector(*r.tag_enu_m);
  }
  void fields(const flight::AnchorFound& e) { out += ' ' + to_string(e.anchor) + (e.now ? " now" : ""); }
  void fields(const flight::AnchorStatusChanged& e) {
    out += ' ' + to_string(e.anchor) + ' ' + std::string(e.status) + ' ' + e.reason;
  }
  void fields(const flight::AnchorEstimated& e) {
    estimate(e.estimate);
    number(e.models_moved_m.value_or(-1));
  }
  void fields(const flight::FixRejected& e) { out += ' ' + e.reason; }
  void fields(const flight::OriginMoved&) {}
};

/// Ranges and fixes as they come.
std::vector<flight::LiveRow> stream(const FlightData& data) {
  std::vector<flight::LiveRow> rows;
  for (const auto& range : data.ranges) rows.emplace_back(flight::PredictedRange{range, {}, range.time});
  for (const auto& fix : data.fixes) rows.emplace_back(fix);
  std::ranges::stable_sort(rows, {}, [](const auto& row) { return flight::time_of(row); });
  return rows;
}

flight::LiveMissionSetup setup_of(const FlightData& data) {
  flight::LiveMissionSetup out;
  out.mission = data.mission;
  out.goal = {.h95_m = 0.5, .v95_m = 0.5};
  return out;
}

/// A flight with a joint solution each 30 s, told to a listener; its events.
std::vector<Event> fly(const FlightData& data) {
  LiveMission mission(setup_of(data));
  std::vector<Event> all;
  const auto take = [&] {
    for (auto& event : mission.take_events()) all.push_back(std::move(event));
  };
  double solved_s = 0;
  std::size_t n = 0;
  for (const auto& row : stream(data)) {
    mission.add(row);
    if (++n % 40 == 0) mission.settle();
    take();
    const double now_s = flight::time_of(row).seconds();
    if (now_s - solved_s < 30 || !mission.joint_is_worth_it()) continue;
    solved_s = now_s;
    const auto problem = mission.joint_problem({});
    if (const auto solution = solve_flight(problem.flight, problem.options)) {
      EXPECT_TRUE(mission.adopt(solution.value(), problem.cut, problem.generation));
    }
    take();
  }
  mission.finish();
  mission.settle();
  take();
  return all;
}

/// An aircraft that looks about, so that its lever arm is seen.
MadeFlight turning() {
  MadeFlight made;
  made.turn_rate_radps = 0.2;
  return made;
}

/// At the end of the flight.
std::size_t n_converged(const std::vector<Event>& events) {
  std::map<NetworkId, std::string_view> status;
  for (const auto& event : events) {
    const auto* told = std::get_if<flight::AnchorEstimated>(&event);
    if (told != nullptr) status[told->estimate.anchor] = flight::anchor_status(told->estimate);
  }
  return static_cast<std::size_t>(
      std::ranges::count_if(status, [](const auto& one) { return one.second == "converged"; }));
}

/// How many anchors the gate ever held back; none of them is called done by then.
std::size_t n_held_back(const std::vector<Event>& events, const std::string& gate) {
  std::set<NetworkId> held;
  for (const auto& event : events) {
    const auto* told = std::get_if<flight::AnchorEstimated>(&event);
    if (told == nullptr) continue;
    const auto& gates = told->estimate.gates;
    const auto at = std::ranges::find(gates, gate, &Gate::name);
    if (at == gates.end() || at->passed) continue;
    EXPECT_NE(flight::anchor_status(told->estimate), "converged") << gate;
    held.insert(told->estimate.anchor);
  }
  return held.size();
}

// One device that invented ids had 2.6 GB of solvers after 18 s.
TEST(LiveMission, OfADeviceThatInventsIdsTheFirstAreFollowedAndAllRowsCounted) {
  const FlightData data = make_flight(turning());
  LiveMission mission(setup_of(data));
  std::size_t n = 0;
  for (const auto& row : stream(data)) {
    mission.add(row);
    const auto* judged = std::get_if<flight::PredictedRange>(&row);
    if (judged == nullptr) continue;
    auto invented = *judged;
    invented.range.anchor = NetworkId{static_cast<std::uint16_t>(2000 + n % 5000)};
    mission.add(flight::LiveRow(invented));
    invented = *judged;
    invented.range.tag = NetworkId{static_cast<std::uint16_t>(9000 + n % 3000)};
    mission.add(flight::LiveRow(invented));
    ++n;
  }
  mission.finish();
  mission.settle();
  EXPECT_EQ(mission.state().n_ranges, 3 * n);
  EXPECT_LE(mission.estimates().size(), k_most_live_anchors);
  std::set<NetworkId> real, followed, tags;
  for (const auto& range : data.ranges) real.insert(range.anchor);
  for (const auto& estimate : mission.estimates()) followed.insert(estimate.anchor);
  EXPECT_TRUE(std::ranges::includes(followed, real)) << "heard first";
  for (const auto& range : mission.joint_problem({}).flight.ranges) tags.insert(range.tag);
  EXPECT_LE(tags.size(), k_most_live_tags);
}

TEST(LiveMission, TheSameRowsGiveTheSameEventsByteForByte) {
  MadeFlight made;
  made.nlos_share = 0.2;
  made.frame = TrackFrame::wgs84;
  const auto data = make_flight(made);
  Dump first, second;
  for (const auto& event : fly(data)) first.event(event);
  for (const auto& event : fly(data)) second.event(event);
  EXPECT_GT(std::ranges::count(first.out, '\n'), 4000);
  EXPECT_EQ(first.out, second.out);
}

TEST(LiveMission, EveryRangeIsDecidedOnceAndEveryAnchorFoundOnce) {
  const auto data = make_flight(turning());
  std::size_t ranges = 0, found = 0;
  const auto events = fly(data);
  for (const auto& event : events) {
    ranges += std::holds_alternative<flight::RangeDecided>(event);
    found += std::holds_alternative<flight::AnchorFound>(event);
  }
  EXPECT_EQ(ranges, data.ranges.size());
  EXPECT_EQ(found, 4U);
  EXPECT_EQ(n_converged(events), 4U);
}

/// An accurate answer may be a wrong one: what a person would be asked about is not called done in flight.
TEST(LiveMission, NoAnchorConvergesThatAGateHoldsBack) {
  // One heading: a lever arm that is wrong would not show.
  const auto one_heading = fly(make_flight(MadeFlight{}));
  EXPECT_EQ(n_held_back(one_heading, "unseen_arm"), 4U);
  EXPECT_EQ(n_converged(one_heading), 0U);
  // Unless the mission says how well it was measured.
  auto declared = make_flight(MadeFlight{});
  declared.mission.lever_arm_sigma_m = 0.02;
  const auto told = fly(declared);
  EXPECT_EQ(n_held_back(told, "unseen_arm"), 0U);
  EXPECT_EQ(n_converged(told), 4U);
  // Two devices with one id: from 60 s on the ranges are those of an anchor elsewhere.
  MadeFlight made = turning(), elsewhere = turning();
  elsewhere.anchors[0] += Eigen::Vector3d(1.5, -1, 0);
  auto data = make_flight(made);
  const auto other = make_flight(elsewhere);
  for (std::size_t i = 0; i < data.ranges.size(); ++i) {
    if (data.ranges[i].time.seconds() > 60) data.ranges[i] = other.ranges[i];
  }
  const auto events = fly(data);
  EXPECT_GE(n_held_back(events, "halves"), 1U);
  EXPECT_EQ(n_converged(events), 3U);
}

/// Too few of the ranges are from its new place for the solution to leave the old one, which stays accurate.
TEST(LiveMission, AnAnchorThatMovedAfterMostOfTheFlightIsHeldBack) {
  const MadeFlight made = turning();
  MadeFlight moved = made;
  moved.anchors[0] += Eigen::Vector3d(2, -1.5, 0);
  auto data = make_flight(made);
  const auto other = make_flight(moved);
  for (std::size_t i = 0; i < data.ranges.size(); ++i) {
    if (data.ranges[i].time.seconds() > 70)
      data.ranges[i] = other.ranges[i];  // 20 s of the last solution's 90
  }
  const auto events = fly(data);
  EXPECT_EQ(n_held_back(events, "second_place"), 1U);
  EXPECT_EQ(n_converged(events), 3U);
}

/// The gates are those of the whole flight: before they were asked nothing is called done.
TEST(LiveMission, NoAnchorConvergesBeforeAJointSolution) {
  const auto data = make_flight(turning());
  LiveMission mission(setup_of(data));
  for (const auto& row : stream(data)) mission.add(row);
  mission.settle();
  EXPECT_EQ(mission.state().anchors_converged, 0U);
  for (const auto& estimate : mission.estimates()) EXPECT_LE(estimate.h95_m, 0.5);  // the goal
  const auto problem = mission.joint_problem({});
  ASSERT_TRUE(
      mission.adopt(solve_flight(problem.flight, problem.options).value(), problem.cut, problem.generation));
  EXPECT_EQ(mission.state().anchors_converged, 4U);
}

/// A model that is metres wrong: applied, its anchors are named; withheld, they stand where they stood
/// without it.
TEST(LiveMission, AlarmsKnowOfCorrectionsThatMoveAnchorsAndOfThoseNotApplied) {
  const auto data = make_flight(turning());
  const auto flown = [&](const std::optional<RangeModel>& model) {
    auto mission = std::make_unique<LiveMission>(setup_of(data));
    for (auto row : stream(data)) {
      if (auto* judged = std::get_if<flight::PredictedRange>(&row)) judged->model = model;
      mission->add(row);
    }
    mission->finish();
    mission->settle();
    return mission;
  };
  const auto pulse = [](LiveMission& mission) { return mission.watch().look(mission.state().time, {}); };
  RangeModel withheld;
  withheld.withheld = "it is of another unit";
  const auto without = flown(std::nullopt), kept = flown(withheld);
  EXPECT_EQ(pulse(*without).models_moved, "");
  EXPECT_EQ(pulse(*without).models_withheld, "");
  EXPECT_EQ(pulse(*kept).models_withheld, withheld.withheld);
  EXPECT_EQ(pulse(*kept).models_moved, "");
  LiveMission silent(setup_of(data));
  for (auto row : stream(data)) {
    if (auto* judged = std::get_if<flight::PredictedRange>(&row)) judged->silent = true;
    silent.add(row);
  }
  EXPECT_NE(pulse(silent).models_withheld.find("lack what they need"), std::string_view::npos)
      << "models that say nothing of a whole flight";
  const auto before = without->estimates(), after = kept->estimates();
  ASSERT_EQ(before.size(), after.size());
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_EQ(before[i].best->position.m, after[i].best->position.m);
}

/// A flight of one height cannot tell an anchor from its mirror image: that a small correction makes the
/// other one the better is no work of the model's.
TEST(LiveMission, SmallCorrectionsMoveNoAnchorAlsoWhereItsMirrorFitsAsWell) {
  MadeFlight level;
  level.height_swing_m = 0;
  for (const std::uint64_t seed : {1, 2, 3}) {
    level.seed = seed;
    const auto data = make_flight(level);
    LiveMission mission(setup_of(data));
    std::string named;
    int n = 0;
    for (auto row : stream(data)) {
      if (auto* judged = std::get_if<flight::PredictedRange>(&row)) {
        judged->model.emplace();
        judged->model->bias_m = 0.25 + 0.15 * std::sin(0.7 * n);
      }
      mission.add(row);
      if (++n % 20 != 0) continue;
      mission.settle();
      named += mission.watch().look(mission.state().time, {}).models_moved;
    }
    EXPECT_EQ(named, "") << "seed " << seed;
  }
}

/// A bias that all ranges have is found by the flight itself; one that grows with the range moves the
/// anchors, and makes them agree so badly that their own regions would excuse it.
TEST(LiveMission, CorrectionsThatAreMetresWrongNameEveryAnchorThatTheyMove) {
  const auto data = make_flight(turning());
  LiveMission mission(setup_of(data));
  for (auto row : stream(data)) {
    if (auto* judged = std::get_if<flight::PredictedRange>(&row)) {
      judged->model.emplace();
      judged->model->bias_m = -0.4 * judged->range.distance_m;
    }
    mission.add(row);
  }
  mission.finish();
  mission.settle();
  const std::string moved(mission.watch().look(mission.state().time, {}).models_moved);
  for (const auto& estimate : mission.estimates())
    EXPECT_NE(moved.find(to_string(estimate.anchor)), std::string::npos) << moved;
}

/// What was stored is counted and estimated, and tells of nothing that happened then.
TEST(LiveMission, ReadingWhatWasStoredTellsTheEstimatesAlone) {
  const auto data = make_flight(MadeFlight{});
  LiveMission mission(setup_of(data));
  mission.begin_reading();
  for (const auto& row : stream(data)) mission.add(row);
  mission.end_reading();
  std::size_t estimates = 0;
  for (const auto& event : mission.take_events()) {
    if (const auto* found = std::get_if<flight::AnchorFound>(&event)) {
      EXPECT_FALSE(found->now);
    } else {
      EXPECT_TRUE(std::holds_alternative<flight::AnchorEstimated>(event)) << event.index();
      ++estimates;
    }
  }
  EXPECT_EQ(estimates, 4U);
  EXPECT_EQ(mission.state().n_ranges, data.ranges.size());
  EXPECT_EQ(mission.state().n_fixes, data.fixes.size());
  EXPECT_EQ(mission.state().anchors_found, 4U);
}

TEST(LiveMission, AJointSolutionOfBeforeItBeganAnewIsNotAdopted) {
  const auto data = make_flight(MadeFlight{});
  LiveMission mission(setup_of(data));
  for (const auto& row : stream(data)) mission.add(row);
  const auto problem = mission.joint_problem({});
  const auto solution = solve_flight(problem.flight, problem.options);
  ASSERT_TRUE(solution.has_value());
  mission.begin_anew({});
  EXPECT_FALSE(mission.adopt(solution.value(), problem.cut, problem.generation));
  EXPECT_EQ(mission.state().n_ranges, 0U);
  EXPECT_TRUE(mission.estimates().empty());
  EXPECT_FALSE(mission.joint_is_worth_it());
}

}  // namespace
}  // namespace anchord::live_mission_test
