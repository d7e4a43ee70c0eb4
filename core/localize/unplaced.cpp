#include "core/localize/unplaced.hpp"

#include <algorithm>
#include <cstdio>
#include <map>
#include <vector>

#include "core/base/median.hpp"

namespace anchord {
namespace {

template <class... Numbers>
std::string text(const char* format, Numbers... numbers) {
  char buffer[300];
  std::snprintf(buffer, sizeof buffer, format, numbers...);
  return buffer;
}

double median_or_zero(std::vector<double> values) { return values.empty() ? 0.0 : upper_median(values); }

std::string gap(const FlightRows& rows) {
  const auto poses = rows.track.poses();
  std::vector<double> interval_s;
  for (std::size_t i = 1; i < poses.size(); ++i) interval_s.push_back(poses[i].t_s - poses[i - 1].t_s);
  const double usual_s = median_or_zero(interval_s);
  std::string why = text(
      "the track has one position in %.3g s, and a straight line across that misses the flight path by "
      "%.2f m (limit 0.5 m, or max_gap_s): give a denser track",
      usual_s, rows.track.interpolation_error().sigma_m(usual_s, 0.5));
  if (usual_s > 20) why += "; if its times are milliseconds: t_s is in seconds";
  return why;
}

std::string outside(const FlightRows& rows) {
  double first_s = 1e300, last_s = -1e300;
  for (const AnchorRows& anchor : rows.anchors) {
    if (anchor.rows.empty()) continue;
    first_s = std::min(first_s, anchor.rows.front().t_s);
    last_s = std::max(last_s, anchor.rows.back().t_s);
  }
  const auto poses = rows.track.poses();
  std::string why =
      text("the ranges are from %.1f to %.1f s, the track from %.1f to %.1f s: both must use one clock",
           first_s, last_s, poses.front().t_s, poses.back().t_s);
  const double ratio = (last_s - first_s) / std::max(rows.track_span_s, 1e-3);
  if (ratio > 100 || ratio < 0.01) why += ", and t_s is in seconds";
  why +=
      "; in tables of other programs --track-time and --range-time (Times of the track, of the ranges) say "
      "unit and clock, rows sent to /fixes and /ranges have t_us in microseconds";
  return why;
}

std::string bounds(const FlightData& flight, const FlightOptions& options) {
  std::vector<double> distances_m;
  for (std::size_t i = 0; i < flight.n_ranges(); ++i) {
    const FlightRange range = flight.range(i);
    if (range.kind == RangeKind::tag_anchor) distances_m.push_back(range.distance_m);
  }
  return text("the median range is %.1f m, usable are %.2f to %.0f m: range_m is in metres",
              median_or_zero(std::move(distances_m)), options.min_range_m, options.max_range_m);
}

}  // namespace

Unplaced unplaced_of(const FlightRows& rows, const FlightData& flight, const FlightOptions& options) {
  Unplaced out;
  std::map<std::string, std::size_t> reasons;
  for (const AnchorRows& anchor : rows.anchors) {
    for (const auto& [why, count] : anchor.refused) {
      if (why == "excluded") continue;  // a person's choice, and no surprise to anybody
      reasons[why] += count;
      out.n_ranges += count;
    }
    for (const JointRow& row : anchor.rows) {
      ++out.n_ranges;
      const TrackRefusal refused = rows.track.at(row.t_s).refused;
      if (refused == TrackRefusal::none) {
        ++out.n_placed;
      } else {
        ++reasons[std::string(to_string(refused))];
      }
    }
  }
  if (reasons.empty() || 2 * out.n_placed >= out.n_ranges) return out;
  const auto most = std::ranges::max_element(reasons, {}, [](const auto& one) { return one.second; });
  const auto& [reason, count] = *most;
  out.why = out.n_placed == 0
                ? text("none of %zu ranges could be placed on the track: ", out.n_ranges)
                : text("only %zu of %zu ranges could be placed on the track: ", out.n_placed, out.n_ranges);
  out.why += text("%zu %s; ", count, reason.c_str());
  if (reason == "track_gap") {
    out.why += gap(rows);
  } else if (reason == "outside_track") {
    out.why += outside(rows);
  } else if (reason == "out_of_bounds" || reason == "zero_range") {
    out.why += bounds(flight, options);
  } else if (reason == "fix_not_good_enough") {
    out.why +=
        "both positions next to a range must be of class min_fix: allow a lower class, or survey with RTK";
  } else if (reason == "unknown_tag") {
    out.why += "the tag and antenna of a range must be declared under tags";
  } else {
    out.why += "see the counts of rejected ranges";
  }
  return out;
}

}  // namespace anchord
