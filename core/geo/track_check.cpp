#include "core/geo/track_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "core/base/median.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/tag_track.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_neighbours = 5;  ///< on either side in arrival, whose stamps a stamp is held against
constexpr double k_ascending_share = 0.9;  ///< fewer, and the order of arrival says nothing
constexpr std::size_t k_step_fixes = 10;
constexpr double k_step_s = 1.0;
constexpr double k_dense_share = 0.5;  ///< of all positions between the ends of a part: fewer are outliers

/// Stamps ahead of, or behind, the neighbours in arrival on both sides.
void check_stamps(std::span<const Fix> fixes, const TrackLimits& limits, std::vector<FixRefusal>& refusals) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    if (refusals[i] == FixRefusal::none) order.push_back(i);
  }
  if (order.size() < 2 * k_neighbours + 1) return;
  const bool received =
      std::ranges::all_of(order, [&](std::size_t i) { return fixes[i].received.has_value(); });
  if (received) std::ranges::stable_sort(order, {}, [&](std::size_t i) { return fixes[i].received->ns; });
  std::size_t ascending = 0;
  for (std::size_t k = 1; k < order.size(); ++k)
    ascending += fixes[order[k - 1]].time <= fixes[order[k]].time ? 1 : 0;
  if (static_cast<double>(ascending) < k_ascending_share * static_cast<double>(order.size() - 1)) return;
  const UtcTime start = fixes[order.front()].time;
  const auto middle_of = [&](std::size_t from, std::size_t to) -> std::optional<double> {
    std::vector<double> stamps;
    for (std::size_t k = from; k < to; ++k) stamps.push_back(seconds_between(start, fixes[order[k]].time));
    return stamps.empty() ? std::nullopt : std::optional(upper_median(stamps));
  };
  for (std::size_t k = 0; k < order.size(); ++k) {
    const auto before = middle_of(k > k_neighbours ? k - k_neighbours : 0, k),
               after = middle_of(k + 1, std::min(order.size(), k + 1 + k_neighbours));
    const double t_s = seconds_between(start, fixes[order[k]].time);
    // At either end there is one side only, and a pause before the last position is no fault of its stamp.
    if (!before || !after) continue;
    if (t_s > std::max(*before, *after) + limits.max_ahead_s) refusals[order[k]] = FixRefusal::future_stamp;
    if (t_s < std::min(*before, *after) - limits.max_disorder_s)
      refusals[order[k]] = FixRefusal::out_of_order;
  }
}

std::string when(const Fix& fix) { return to_rfc3339(fix.time); }

}  // namespace

FixRefusal why_apart(const TrackSegments::Segment& part, const TrackSegments::Segment& flight,
                     double max_pause_s, std::size_t n_between) {
  if (part.first_s > flight.last_s + max_pause_s) return FixRefusal::future_stamp;
  if (part.last_s < flight.first_s - max_pause_s) return FixRefusal::past_stamp;
  const bool long_enough = part.n >= k_step_fixes && part.last_s - part.first_s >= k_step_s;
  const bool dense = static_cast<double>(part.n) > k_dense_share * static_cast<double>(n_between);
  return long_enough && dense ? FixRefusal::step : FixRefusal::jump;
}

Fix believed_class(const Fix& fix, const TrackLimits& limits) {
  Fix out = fix;
  if (fix.fix != FixClass::rtk_fixed || !fix.correction_age_s ||
      *fix.correction_age_s <= limits.max_correction_age_s)
    return out;
  out.fix = FixClass::rtk_float;
  if (out.covariance_m2) {
    // It claims what it had when the corrections were fresh.
    const double sigma_m = default_sigma_m(FixClass::rtk_float);
    out.covariance_m2->diagonal().array() += sigma_m * sigma_m;
  }
  return out;
}

bool usable(const Fix& fix, TrackFrame frame) {
  if (fix.frame != frame || fix.fix == FixClass::none) return false;
  if (fix.covariance_m2 && !fix.covariance_m2->allFinite()) return false;
  if (frame == TrackFrame::local) return fix.local_m.allFinite() && fix.local_m.norm() < 1e6;
  const Wgs84& p = fix.position;
  return std::isfinite(p.lat_deg) && std::isfinite(p.lon_deg) && std::isfinite(p.height_m) &&
         std::abs(p.lat_deg) <= 90 && std::abs(p.lon_deg) <= 180 && p.height_m >= -500 &&
         p.height_m <= 9000 && !(p.lat_deg == 0 && p.lon_deg == 0);
}

Eigen::Vector3d fixed_place_m(const Fix& fix) {
  return fix.frame == TrackFrame::wgs84 ? ecef_from_wgs84(fix.position) : fix.local_m;
}

double jump_sigma_m(const Fix& fix) {
  const double of_class_m = default_sigma_m(fix.fix);
  if (!fix.covariance_m2) return of_class_m;
  return std::min(std::sqrt(std::max(fix.covariance_m2->diagonal().maxCoeff(), 0.0)), 5 * of_class_m);
}

Wgs84 robust_centre(std::span<const Wgs84> places) {
  const EnuFrame frame(places.front());
  std::array<std::vector<double>, 3> axes;
  for (const auto& place : places) {
    const Eigen::Vector3d at_m = frame.enu_from_wgs84(place).m;
    for (int axis = 0; axis < 3; ++axis) axes[static_cast<std::size_t>(axis)].push_back(at_m[axis]);
  }
  Enu middle;
  for (int axis = 0; axis < 3; ++axis) middle.m[axis] = upper_median(axes[static_cast<std::size_t>(axis)]);
  return frame.wgs84_from_enu(middle);
}

namespace {

/// Good positions are held against each other; the others are neighbours at most, and say nothing about good
/// ones. `order`: those not refused so far, by time.
std::vector<std::size_t> good_ones(const std::vector<Fix>& all, const std::vector<std::size_t>& order,
                                   FixClass min_fix) {
  FixClass best = FixClass::none;
  for (const std::size_t i : order) best = std::max(best, all[i].fix);
  const FixClass judged = std::min(best, min_fix);
  std::vector<std::size_t> good;
  for (const std::size_t i : order) {
    if (all[i].fix >= judged) good.push_back(i);
  }
  return good;
}

/// Refuses what no aircraft could have flown together with most of the rest; the others of `good`.
std::vector<std::size_t> keep_flight(const std::vector<Fix>& all, const std::vector<std::size_t>& good,
                                     const TrackLimits& limits, CheckedTrack& out) {
  TrackSegments segments(limits);
  std::vector<std::size_t> part(good.size());
  std::vector<std::pair<std::size_t, std::size_t>> ends;  // by part: first and last place in `good`
  const UtcTime start = all[good.front()].time;
  for (std::size_t k = 0; k < good.size(); ++k) {
    const Fix& fix = all[good[k]];
    part[k] = segments.add(seconds_between(start, fix.time), fixed_place_m(fix), jump_sigma_m(fix));
    if (part[k] == ends.size()) ends.emplace_back(k, k);
    ends[part[k]].second = k;
  }
  const std::size_t flight = segments.largest();
  std::size_t n_step = 0;
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < good.size(); ++k) {
    if (part[k] == flight) {
      kept.push_back(good[k]);
      continue;
    }
    const auto& [first, last] = ends[part[k]];
    const FixRefusal why =
        why_apart(segments.segment(part[k]), segments.segment(flight), limits.max_pause_s, last - first + 1);
    out.refusals[good[k]] = why;
    n_step += why == FixRefusal::step ? 1 : 0;
    if (why == FixRefusal::step && k == first) {
      char text[160];
      const auto& s = segments.segment(part[k]);
      std::snprintf(text, sizeof text,
                    "%zu positions over %.0f s are shifted together against the rest of the flight (base "
                    "moved?), from ",
                    s.n, s.last_s - s.first_s);
      out.notes.push_back(text + when(all[good[k]]) + ": left out");
    }
  }
  out.step_share = static_cast<double>(n_step) / static_cast<double>(good.size());
  return kept;
}

/// The middle of the flight, and away with what is far from it.
void find_centre(const std::vector<Fix>& all, const std::vector<std::size_t>& order,
                 const std::vector<std::size_t>& flight, const TrackLimits& limits, CheckedTrack& out) {
  std::vector<Wgs84> places;
  for (const std::size_t i : flight) places.push_back(all[i].position);
  out.centre = robust_centre(places);
  const Eigen::Vector3d middle_m = ecef_from_wgs84(*out.centre);
  for (const std::size_t i : order) {
    if (out.refusals[i] == FixRefusal::none &&
        (fixed_place_m(all[i]) - middle_m).norm() > limits.max_distance_m)
      out.refusals[i] = FixRefusal::far_away;
  }
}

/// Counts and notes of what was left out, with the first of each reason.
void note_refused(std::span<const Fix> fixes, CheckedTrack& out) {
  std::map<std::string, const Fix*> first_of;
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    if (out.refusals[i] == FixRefusal::none) continue;
    const std::string word(to_string(out.refusals[i]));
    ++out.refused[word];
    auto& first = first_of.try_emplace(word, &fixes[i]).first->second;
    if (fixes[i].time < first->time) first = &fixes[i];
  }
  for (const auto& [word, n] : out.refused)
    out.notes.push_back(std::to_string(n) + " positions left out as " + word + ", the first of " +
                        when(*first_of[word]));
}

}  // namespace

CheckedTrack check_track(std::span<const Fix> fixes, TrackFrame frame, FixClass min_fix,
                         const TrackLimits& limits) {
  CheckedTrack out;
  out.refusals.assign(fixes.size(), FixRefusal::none);
  std::vector<Fix> all;
  all.reserve(fixes.size());
  std::size_t n_old = 0;
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    all.push_back(believed_class(fixes[i], limits));
    if (!usable(fixes[i], frame))
      out.refusals[i] = FixRefusal::not_usable;
    else if (all.back().fix != fixes[i].fix)
      ++n_old;
  }
  check_stamps(fixes, limits, out.refusals);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (out.refusals[i] == FixRefusal::none) order.push_back(i);
  }
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return all[i].time.ns; });
  const auto good = good_ones(all, order, min_fix);
  if (good.empty()) {
    for (const auto why : out.refusals)
      if (why != FixRefusal::none) ++out.refused[std::string(to_string(why))];
    return out;
  }
  const auto flight = keep_flight(all, good, limits, out);
  if (frame == TrackFrame::wgs84) find_centre(all, order, flight, limits, out);
  for (const std::size_t i : order) {
    if (out.refusals[i] == FixRefusal::none) out.fixes.push_back(std::move(all[i]));
  }
  note_refused(fixes, out);
  if (n_old > 0) {
    out.refused[std::string(k_old_correction)] = n_old;
    char text[120];
    std::snprintf(text, sizeof text, "%zu positions had corrections older than %.0f s and count as float",
                  n_old, limits.max_correction_age_s);
    out.notes.emplace_back(text);
  }
  return out;
}

}  // namespace anchord
