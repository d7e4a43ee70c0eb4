#include "core/procedure/machine.hpp"
#include "tests/paths.hpp"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <map>
#include <numbers>
#include <set>
#include <sstream>

namespace anchord::procedure::machine_test {
namespace {

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  std::string cell;
  std::getline(in, cell, '|');
  while (std::getline(in, cell, '|')) {
    const auto from = cell.find_first_not_of(' '), to = cell.find_last_not_of(' ');
    cells.push_back(from == std::string::npos ? "" : cell.substr(from, to - from + 1));
  }
  return cells;
}

/// Rows of the table of docs/procedure.md, "any in flight" expanded as the page says.
std::vector<std::string> documented() {
  std::ifstream file(std::string(ANCHORD_TEST_DATA) + "/../../docs/procedure.md");
  std::vector<std::string> out;
  std::string line;
  while (std::getline(file, line)) {
    const auto cells = cells_of(line);
    if (cells.size() != 5 || !k_trigger_words.find(cells[1])) continue;
    const std::string rest = cells[1] + "|" + cells[2] + "|" + cells[3] + "|" + cells[4];
    if (cells[0].rfind("any in flight", 0) != 0) {
      out.push_back(cells[0] + "|" + rest);
      continue;
    }
    for (std::size_t i = 0; i < k_step_words.size(); ++i) {
      const auto step = std::string(to_string(static_cast<Step>(i)));
      if (step == "ready" || step == "landing" || step == "done") continue;
      if (cells[0] == "any in flight but " + step) continue;
      out.push_back(step + "|" + rest);
    }
  }
  return out;
}

std::string row_of(const Transition& t) {
  std::string out;
  for (const auto word : {to_string(t.from), to_string(t.trigger), to_string(t.guard), to_string(t.to)}) {
    out += std::string(word) + "|";
  }
  return out + std::string(t.reason);
}

Settings two_waypoints() {
  Settings s;
  s.waypoints = {{{0, 0, 4}, 0.5, true, true, true, 4}, {{12, 0, 4}, 1.0, true, true, true, 4}};
  return s;
}

AnchorTask heard(bool bearing, bool height) {
  AnchorTask task;
  task.id = {0x6a21};
  task.has_bearing = bearing;
  task.has_height = height;
  task.samples_here = 5;
  return task;
}

/// States that differ in all that guards ask for.
std::vector<State> variants(Step step) {
  std::vector<State> out;
  for (const std::size_t waypoint : {0u, 1u}) {
    for (const int tries : {0, 2}) {
      for (const int left : {0, 3}) {
        for (const Step interrupted : {Step::ranging, Step::return_home, Step::go_to_point}) {
          for (const auto& anchors : {std::vector<AnchorTask>{},
                                      {heard(false, false)},
                                      {heard(true, false)},
                                      {heard(true, true)}}) {
            State s;
            s.step = step;
            s.waypoint = waypoint;
            s.tries = tries;
            s.moves = left;
            s.legs = left;
            s.interrupted = interrupted;
            s.anchors = anchors;
            out.push_back(s);
          }
        }
      }
    }
  }
  return out;
}

State at(Step step) {
  State s;
  s.step = step;
  s.target_m = {0, 0, 4};
  return s;
}
Advance after(const Settings& settings, State state, std::initializer_list<Trigger> events) {
  Advance out{std::move(state), {}, nullptr};
  double now = 0;
  for (const auto trigger : events)
    out = advance(settings, out.state, {trigger, now += 1, Eigen::Vector3d(5, 5, 4), {}, {}});
  return out;
}

TEST(ProcedureMachine, HasExactlyTheTransitionsOfTheDocumentation) {
  std::multiset<std::string> code;
  for (const auto& t : transitions()) code.insert(row_of(t));
  const auto rows = documented();
  const std::multiset<std::string> page(rows.begin(), rows.end());
  ASSERT_FALSE(page.empty());
  for (const auto& row : page)
    EXPECT_EQ(code.count(row), page.count(row)) << "documented and not so: " << row;
  for (const auto& row : code) EXPECT_EQ(page.count(row), code.count(row)) << "not documented so: " << row;
}

TEST(ProcedureMachine, TriesRowsInTheOrderOfTheDocumentation) {
  std::map<std::pair<std::string, std::string>, std::vector<std::string>> code, page;
  for (const auto& t : transitions()) {
    code[{std::string(to_string(t.from)), std::string(to_string(t.trigger))}].emplace_back(
        to_string(t.guard));
  }
  for (const auto& row : documented()) {
    std::istringstream in(row);
    std::string from, trigger, guard;
    std::getline(in, from, '|');
    std::getline(in, trigger, '|');
    std::getline(in, guard, '|');
    page[{from, trigger}].push_back(guard);
  }
  EXPECT_EQ(code, page);
}

TEST(ProcedureMachine, EveryTransitionIsReached) {
  const auto settings = two_waypoints();
  for (const auto& wanted : transitions()) {
    bool reached = false;
    for (const auto& state : variants(wanted.from)) {
      const auto step = advance(settings, state, {wanted.trigger, 10, Eigen::Vector3d(5, 5, 4), {}, "cause"});
      if (step.transition != &wanted) continue;
      reached = true;
      EXPECT_EQ(step.state.step, wanted.to);
      EXPECT_EQ(step.state.reason, std::string(wanted.reason) + ": cause");
      EXPECT_EQ(step.state.since_s, 10);
      EXPECT_EQ(step.state.n_transitions, 1u);
    }
    EXPECT_TRUE(reached) << row_of(wanted);
  }
}

TEST(ProcedureMachine, EveryStepInFlightHasALongestStayAndAWayOut) {
  const auto settings = two_waypoints();
  for (std::size_t i = 0; i < k_step_words.size(); ++i) {
    const auto step = static_cast<Step>(i);
    if (step == Step::ready || step == Step::done) continue;
    for (const auto& state : variants(step)) {
      EXPECT_NE(advance(settings, state, {Trigger::timeout, 1, {}, {}, {}}).transition, nullptr)
          << to_string(step);
    }
  }
  for (const auto& t : transitions()) {
    for (const auto& state : variants(t.from)) {
      const auto step = advance(settings, state, {t.trigger, 10, Eigen::Vector3d(5, 5, 4), {}, {}});
      if (step.state.step == Step::done) continue;
      EXPECT_GT(step.state.deadline_s, 10) << row_of(t);
    }
  }
}

TEST(ProcedureMachine, AnEventWithoutARowChangesNothing) {
  const auto state = at(Step::ranging);
  const auto step = advance(two_waypoints(), state, {Trigger::airborne, 5, {}, {}, {}});
  EXPECT_EQ(step.transition, nullptr);
  EXPECT_EQ(step.state.step, Step::ranging);
  EXPECT_TRUE(step.commands.empty());
}

// Eq 8.6 with k = 3 between (0,0,4) and (12,0,4): 4, 8, 12 m; then the next waypoint is the present one.
TEST(ProcedureMachine, StepsTowardsTheNextWaypointInKParts) {
  const auto settings = two_waypoints();
  State s = at(Step::search_anchors);
  s.moves = 3;
  for (const double x : {4.0, 8.0, 12.0}) {
    const auto step = advance(settings, s, {Trigger::timeout, 1, {}, {}, {}});
    ASSERT_EQ(step.state.step, Step::step_to_waypoint);
    ASSERT_EQ(step.commands.size(), 1u);
    EXPECT_TRUE(step.commands[0].point_m.isApprox(Eigen::Vector3d(x, 0, 4)));
    s = advance(settings, step.state, {Trigger::arrived, 2, {}, {}, {}}).state;
    s.moves = 3;
  }
  EXPECT_EQ(s.waypoint, 1u);
  EXPECT_EQ(advance(settings, s, {Trigger::timeout, 3, {}, {}, {}}).state.step, Step::return_home);
}

TEST(ProcedureMachine, MovesInThreeDirectionsBeforeItGoesOn) {
  const auto settings = two_waypoints();
  State s = at(Step::search_anchors);
  s.centre_m = {0, 0, 4};
  for (const auto& to : {Eigen::Vector3d(2, 0, 4), Eigen::Vector3d(0, 2, 4), Eigen::Vector3d(0, 0, 6)}) {
    const auto step = advance(settings, s, {Trigger::timeout, 1, {}, {}, {}});
    ASSERT_EQ(step.state.step, Step::move_around);
    EXPECT_TRUE(step.commands[0].point_m.isApprox(to));
    s = advance(settings, step.state, {Trigger::arrived, 2, {}, {}, {}}).state;
  }
  EXPECT_EQ(advance(settings, s, {Trigger::timeout, 3, {}, {}, {}}).state.step, Step::step_to_waypoint);
}

TEST(ProcedureMachine, TurnsInFourQuartersOnTheSpotThenSearchesTheHeight) {
  const auto settings = two_waypoints();
  State s = at(Step::search_anchors);
  s.heading_rad = 0.0;
  s.anchors = {heard(false, false)};
  auto step = advance(settings, s, {Trigger::in_range, 1, {}, {}, {}});
  std::vector<double> headings;
  while (step.state.step == Step::turn) {
    headings.push_back(*step.commands[0].heading_rad);
    EXPECT_TRUE(step.commands[0].point_m.isApprox(s.target_m));
    step.state.anchors[0].samples_here = 30;
    step = advance(settings, step.state, {Trigger::arrived, 2, {}, {}, {}});
  }
  ASSERT_EQ(headings.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(
        std::remainder(headings[i] - static_cast<double>(i + 1) * std::numbers::pi / 2, 2 * std::numbers::pi),
        0, 1e-12);
  }
  EXPECT_TRUE(step.state.anchors[0].has_bearing);
  std::vector<double> heights;
  while (step.state.step == Step::height_search) {
    heights.push_back(step.commands[0].point_m.z());
    step.state.anchors[0].samples_here = 30;
    step = advance(settings, step.state, {Trigger::arrived, 3, {}, {}, {}});
  }
  EXPECT_EQ(heights, (std::vector<double>{5.5, 2.5, 4.0}));
  EXPECT_EQ(step.state.step, Step::ranging);
  EXPECT_TRUE(step.state.anchors[0].has_height);
}

TEST(ProcedureMachine, FliesNoHeightSearchForAnAnchorThatTheTurnDidNotSee) {
  const auto settings = two_waypoints();
  State s = at(Step::search_anchors);
  s.anchors = {heard(true, false)};
  s.anchors[0].no_lobe = true;
  EXPECT_EQ(advance(settings, s, {Trigger::in_range, 1, {}, {}, {}}).state.step, Step::ranging);
  s.anchors.push_back(heard(true, false));  // somebody else's can be seen
  auto step = advance(settings, s, {Trigger::in_range, 1, {}, {}, {}});
  while (step.state.step == Step::height_search) {
    for (auto& a : step.state.anchors) a.samples_here = 30;
    step = advance(settings, step.state, {Trigger::arrived, 2, {}, {}, {}});
  }
  EXPECT_FALSE(step.state.anchors[0].has_height) << "its turn comes when it is nearer";
  EXPECT_TRUE(step.state.anchors[1].has_height);
}

TEST(ProcedureMachine, RemembersAPointItCouldNotReachAndGoesBack) {
  State s = at(Step::find_next_point);
  s.target_m = {1, 1, 4};
  const auto there = advance(two_waypoints(), s, {Trigger::point, 1, Eigen::Vector3d(5, 5, 4), {}, {}});
  const auto back = advance(two_waypoints(), there.state, {Trigger::unreachable, 2, {}, {}, {}});
  EXPECT_EQ(back.state.step, Step::go_back);
  EXPECT_TRUE(back.commands[0].point_m.isApprox(Eigen::Vector3d(1, 1, 4)));
  ASSERT_EQ(back.state.unreachable.size(), 1u);
  EXPECT_TRUE(back.state.unreachable[0].isApprox(Eigen::Vector3d(5, 5, 4)));
}

TEST(ProcedureMachine, AnchorsShareTheAircraftFairly) {
  // Ten anchors of which only one answers at each point: who waited longest counts most, and nobody waits for
  // ever.
  const auto settings = two_waypoints();
  State s = at(Step::ranging);
  for (std::uint32_t i = 0; i < 10; ++i) note_range(s, {0x6a00 + i});
  std::vector<std::size_t> served;
  for (int round = 0; round < 40; ++round) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < 10; ++i) {
      if (weight_of(s.anchors[i]) > weight_of(s.anchors[best])) best = i;
    }
    served.push_back(best);
    for (auto& a : s.anchors) a.samples_here = 0;
    s.anchors[best].samples_here = 20;
    s.step = Step::ranging;
    s = advance(settings, s, {Trigger::sampled, static_cast<double>(round), {}, {}, {}}).state;
  }
  std::array<int, 10> counts{};
  for (const auto i : served) ++counts[i];
  for (const int n : counts) EXPECT_EQ(n, 4);
  s.anchors[3].done = true;
  EXPECT_EQ(weight_of(s.anchors[3]), 0);
}

TEST(ProcedureMachine, ARestartedServerTellsTheAircraftToHoldFirst) {
  for (std::size_t i = 0; i < k_step_words.size(); ++i) {
    const auto step = static_cast<Step>(i);
    const auto back = resume_after_restart(at(step), 100);
    if (step == Step::ready || step == Step::done) {
      EXPECT_TRUE(back.commands.empty());
      continue;
    }
    ASSERT_EQ(back.commands.size(), 1u);
    EXPECT_EQ(back.commands[0].kind, step == Step::landing ? Command::Kind::land : Command::Kind::hold);
  }
  auto stored = at(Step::ranging);
  stored.points = 2;
  const auto resumed =
      advance(two_waypoints(), resume_after_restart(stored, 100).state, {Trigger::resume, 101, {}, {}, {}});
  EXPECT_EQ(resumed.state.step, Step::go_to_point);
  EXPECT_TRUE(resumed.commands[0].point_m.isApprox(stored.target_m));
}

TEST(ProcedureMachine, HoldReturnAndLandWorkInEveryStepInFlight) {
  for (std::size_t i = 1; i + 2 < k_step_words.size(); ++i) {
    const auto step = static_cast<Step>(i);
    EXPECT_EQ(after(two_waypoints(), at(step), {Trigger::hold}).state.step, Step::hold);
    EXPECT_EQ(after(two_waypoints(), at(step), {Trigger::return_home}).state.step, Step::return_home);
    const auto landing = after(two_waypoints(), at(step), {Trigger::land});
    EXPECT_EQ(landing.state.step, Step::landing);
    EXPECT_EQ(landing.commands[0].kind, Command::Kind::land);
  }
}

TEST(ProcedureMachine, SettingsWithoutAWaypointAreRefused) {
  EXPECT_FALSE(Settings{}.check().has_value());
  EXPECT_TRUE(two_waypoints().check().has_value());
}

}  // namespace
}  // namespace anchord::procedure::machine_test
