#include "core/localize/error_question.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string_view>

#include "core/localize/joint_lines.hpp"

namespace anchord {
namespace {

constexpr double k_failing_z = 4.0;

// 2 to 10 % are what wrong clocks and units do.
constexpr KnownError k_factor_of_all{0.05, 0.005, 0.07}, k_factor_of_some{0.05, 0.005, 0.05};
constexpr KnownError k_height_step{0.3, 0.10, 0.02}, k_drift{0.3, 0.10, 0.02};
// Positions that are no RTK fixes but pass for some, and heights of a barometer.
constexpr KnownError k_track_drift{0.5, 0.15, 0.002}, k_track_heights{0.05, 0.02, 0.005};

std::string whose(const FlightRows& flight, const ErrorQuestion& question) {
  if (question.antenna) {
    const FlightAntenna& of = flight.antennas[*question.antenna];
    return "to antenna " + std::to_string(of.antenna) + " of tag " + to_string(of.tag);
  }
  return question.anchor ? "of this anchor" : "all ranges";
}

std::string why_factor(const FlightRows& flight, const ErrorAnswer& worst) {
  const ErrorFinding& found = worst.found;
  char text[400];
  if (worst.over_limit() <= 1)
    std::snprintf(text, sizeof text,
                  "no scale error of the ranges is seen: %s %+.2f %% with sigma %.2f %% (%.1f sigma)",
                  whose(flight, worst.question).c_str(), 100 * found.value, 100 * found.sigma,
                  std::abs(found.z));
  else
    std::snprintf(
        text, sizeof text,
        "the ranges are too %s by a factor (%s): %.4f with sigma %.4f (%.1f sigma); check the unit of "
        "the ranges, the clock and the delay settings of the radios, correct the ranges and solve "
        "again",
        found.value > 0 ? "long" : "short", whose(flight, worst.question).c_str(), 1 + found.value,
        found.sigma, std::abs(found.z));
  return text;
}

std::string why_step(const FlightMiddle& middle, const ErrorAnswer& answer) {
  const ErrorFinding& found = answer.found;
  char text[400];
  if (answer.over_limit() <= 1)
    std::snprintf(
        text, sizeof text,
        "no step of the ranges between low and high is seen: %+.3f m with sigma %.3f m (%.1f sigma)",
        found.value, found.sigma, std::abs(found.z));
  else
    std::snprintf(
        text, sizeof text,
        "ranges measured above %.1f m (over the origin) are %.2f m too %s against those below, with "
        "sigma %.2f m (%.1f sigma): a reflection or the antenna; fly with the tag mounted "
        "otherwise, or exclude the ranges of one half",
        middle.up_m, std::abs(found.value), found.value > 0 ? "long" : "short", found.sigma,
        std::abs(found.z));
  return text;
}

std::string why_drift(const ErrorAnswer& answer) {
  const ErrorFinding& found = answer.found;
  char text[400];
  if (answer.over_limit() <= 1)
    std::snprintf(text, sizeof text,
                  "no drift of the ranges in time is seen: %+.3f m over the flight with sigma %.3f m (%.1f "
                  "sigma)",
                  found.value, found.sigma, std::abs(found.z));
  else
    std::snprintf(text, sizeof text,
                  "the ranges %s by %.2f m over the flight with sigma %.2f m (%.1f sigma): a radio that was "
                  "not warm, or a clock; let the tag run for ten minutes and fly again",
                  found.value > 0 ? "grow" : "shrink", std::abs(found.value), found.sigma, std::abs(found.z));
  return text;
}

std::string why_track_drift(const ErrorAnswer& answer) {
  constexpr std::array k_ways{"eastward", "northward", "in height"};
  const ErrorFinding& found = answer.found;
  const char* way = k_ways[answer.question.axis()];
  const char* course = answer.question.bends() == 0 ? "over the flight" : "to and fro during the flight";
  // From the lowest to the highest value of each of error_columns' polynomials.
  constexpr std::array<double, k_track_bends> k_spans{1.0, 1.5, 2.0};
  const double size_m = k_spans[answer.question.bends()] * std::abs(found.value);
  char text[400];
  if (answer.over_limit() <= 1)
    std::snprintf(text, sizeof text, "no drift of the positions is seen: at most %.3f m %s %s (%.1f sigma)",
                  size_m, way, course, std::abs(found.z));
  else
    std::snprintf(text, sizeof text,
                  "by the ranges the positions of the track drift by %.2f m %s %s (%.1f sigma), as RTK fixed "
                  "ones do not: check the fix class and the base%s, and fly again",
                  size_m, way, course, std::abs(found.z),
                  answer.question.axis() == 2 ? ", and that the heights are not of a barometer" : "");
  return text;
}

std::string why_track_heights(const ErrorAnswer& answer) {
  const ErrorFinding& found = answer.found;
  char text[400];
  if (answer.over_limit() <= 1)
    std::snprintf(
        text, sizeof text,
        "the heights of the track differ from each other as the ranges have it: factor %.3f with sigma "
        "%.3f (%.1f sigma)",
        1 + found.value, found.sigma, std::abs(found.z));
  else
    std::snprintf(text, sizeof text,
                  "by the ranges the heights of the track are too far %s by a factor of %.3f with sigma %.3f "
                  "(%.1f sigma): heights of a barometer, or in another unit; use those of the RTK receiver",
                  found.value > 0 ? "apart" : "together", 1 + found.value, found.sigma, std::abs(found.z));
  return text;
}

std::string why(const FlightRows& flight, const FlightMiddle& middle, const ErrorAnswer& answer) {
  switch (answer.question.kind()) {
    case ErrorKind::factor:
      return why_factor(flight, answer);
    case ErrorKind::step:
      return why_step(middle, answer);
    case ErrorKind::drift:
      return why_drift(answer);
    case ErrorKind::track_heights:
      return why_track_heights(answer);
    case ErrorKind::track_drift:
      break;
  }
  return why_track_drift(answer);
}

/// The gate that a kind of error speaks in.
std::string_view gate_of(ErrorKind kind) {
  constexpr std::array<std::string_view, k_track_columns + 1> k_gates{
      "range_scale", "range_step", "range_drift", "track_heights", "track_drift"};
  return k_gates[static_cast<std::size_t>(kind)];
}

}  // namespace

const KnownError& ErrorQuestion::known() const {
  switch (kind()) {
    case ErrorKind::factor:
      break;
    case ErrorKind::step:
      return k_height_step;
    case ErrorKind::drift:
      return k_drift;
    case ErrorKind::track_heights:
      return k_track_heights;
    case ErrorKind::track_drift:
      return k_track_drift;
  }
  return all() ? k_factor_of_all : k_factor_of_some;
}

std::vector<ErrorQuestion> error_questions(const FlightRows& flight, const JointFit& fit) {
  std::vector<ErrorQuestion> questions;
  for (std::size_t k = 0; k < k_error_columns; ++k) questions.push_back({.column = k});
  for (std::size_t k = 0; flight.antennas.size() > 1 && k < flight.antennas.size(); ++k)
    questions.push_back({.antenna = k});
  for (std::size_t i = 0; i < flight.anchors.size(); ++i)
    if (fit.state.anchors[i].active) questions.push_back({.anchor = i});
  return questions;
}

double chance_of_no_error() {
  double chance = 1.0 - k_factor_of_some.chance;
  for (std::size_t k = 0; k < k_error_columns; ++k) chance -= ErrorQuestion{.column = k}.known().chance;
  return chance;
}

std::size_t antenna_of(const FlightRows& flight, const JointRow& row) {
  const auto at = std::ranges::find_if(flight.antennas, [&](const FlightAntenna& one) {
    return one.tag == row.tag && one.antenna == row.antenna;
  });
  return static_cast<std::size_t>(at - flight.antennas.begin());
}

FlightMiddle middle_of(const FlightRows& flight, const JointState& state) {
  std::vector<double> ups_m;
  double from_s = std::numeric_limits<double>::infinity(), to_s = -from_s;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    if (!state.anchors[i].active) continue;
    const JointLines lines(flight.track, flight.anchors[i].rows, state.shared, state.anchors[i]);
    const auto of_rows_m = lines.of(JointLines::antenna_z);
    ups_m.insert(ups_m.end(), of_rows_m.begin(), of_rows_m.end());
    for (const JointRow* row : lines.rows()) {
      from_s = std::min(from_s, row->t_s);
      to_s = std::max(to_s, row->t_s);
    }
  }
  if (ups_m.empty()) return {};
  const auto half = ups_m.begin() + static_cast<std::ptrdiff_t>(ups_m.size() / 2);
  std::ranges::nth_element(ups_m, half);
  return {*half, from_s, std::max(to_s - from_s, 1.0)};
}

ErrorColumns error_columns(const FlightMiddle& middle, double t_s, double antenna_up_m,
                           const Eigen::Vector3d& to_anchor_m) {
  const double distance_m = to_anchor_m.norm(), share = (t_s - middle.from_s) / middle.length_s;
  ErrorColumns out{distance_m, antenna_up_m > middle.up_m ? 1.0 : 0.0, share};
  // A position that is off by a vector is seen as an anchor off by its opposite.
  const Eigen::Vector3d by_position = to_anchor_m / std::max(distance_m, 1e-9);
  out[static_cast<std::size_t>(ErrorKind::track_heights)] = by_position.z() * (antenna_up_m - middle.up_m);
  // Legendre's polynomials: none has a mean, for where the track is off as a whole nothing tells.
  const double x = std::clamp(2 * share - 1, -1.0, 1.0);
  const std::array<double, k_track_bends> waves{0.5 * x, 0.5 * (3 * x * x - 1),
                                                0.5 * (5 * x * x * x - 3 * x)};
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t bends = 0; bends < k_track_bends; ++bends)
      out[k_track_columns + axis * k_track_bends + bends] =
          by_position[static_cast<Eigen::Index>(axis)] * waves[bends];
  return out;
}

double ErrorAnswer::limit() const { return std::max(question.known().failing, k_failing_z * found.sigma); }
double ErrorAnswer::over_limit() const { return std::abs(found.value) / limit(); }

std::vector<Gate> error_gates(const FlightRows& flight, const FlightMiddle& middle,
                              const std::vector<ErrorAnswer>& answers, std::size_t anchor) {
  std::vector<const ErrorAnswer*> worst;
  for (const ErrorAnswer& answer : answers) {
    if (answer.question.anchor && *answer.question.anchor != anchor) continue;
    const auto same = std::ranges::find_if(worst, [&](const ErrorAnswer* other) {
      return gate_of(other->question.kind()) == gate_of(answer.question.kind());
    });
    if (same == worst.end())
      worst.push_back(&answer);
    else if (answer.over_limit() > (*same)->over_limit())
      *same = &answer;
  }
  std::vector<Gate> gates;
  for (const ErrorAnswer* one : worst)
    gates.push_back({std::string(gate_of(one->question.kind())), std::abs(one->found.value), one->limit(),
                     one->over_limit() <= 1, why(flight, middle, *one)});
  return gates;
}

}  // namespace anchord
