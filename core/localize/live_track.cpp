#include "core/localize/live_track.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace anchord {
namespace {

constexpr std::size_t k_least_unsorted = 20;
constexpr double k_unsorted_share = 0.125;  ///< of all, and they are judged again: few times in a flight
constexpr double k_outgrown = 1.1;          ///< times as many, and three: one outlier more flips nothing
constexpr std::size_t k_outgrown_more = 3;
constexpr std::size_t k_told_parts =
    3;                             ///< positions that agree are where the aircraft is, whatever the base
constexpr double k_reach_m = 1.0;  ///< beside speed, of a position that came out of order

void join(LiveTrack::Change& a, LiveTrack::Change b) {
  if (b.added) {
    a.from_s = a.added ? std::min(a.from_s, b.from_s) : b.from_s;
    a.to_s = a.added ? std::max(a.to_s, b.to_s) : b.to_s;
  }
  a.added |= b.added;
  a.rebuilt |= b.rebuilt;
  if (b.newest) a.newest = std::move(b.newest);
}

}  // namespace

LiveTrack::LiveTrack(TrackFrame kind, Options options)
    : kind_(kind), options_(std::move(options)), segments_(options_.limits) {
  if (kind_ == TrackFrame::wgs84 && options_.origin) {
    frame_.emplace(*options_.origin);
    origin_m_ = ecef_from_wgs84(*options_.origin);
  }
}

Eigen::Vector3d LiveTrack::in_frame(const Eigen::Vector3d& place_m) const {
  return frame_ ? Eigen::Vector3d(frame_->enu_from_ecef() * (place_m - origin_m_)) : place_m;
}

LiveTrack::Change LiveTrack::add(const Fix& given) {
  if (!usable(given, kind_)) {
    ++counted_[std::string(to_string(FixRefusal::not_usable))];
    return {};
  }
  const Fix fix = believed_class(given, options_.limits);
  if (fix.fix != given.fix) ++counted_[std::string(k_old_correction)];
  // A bad origin would shift every later number by metres.
  if (kind_ == TrackFrame::wgs84 && !frame_ && fix.fix < options_.min_fix) return {};
  if (!epoch_) epoch_ = fix.time;
  Change change;
  if (pending_) {
    const Fix held = *std::exchange(pending_, std::nullopt);
    if (seconds(fix) >= seconds(held) - options_.limits.max_ahead_s)
      change = process(held);
    else
      ++counted_[std::string(to_string(FixRefusal::future_stamp))];
  }
  if (flight_ && seconds(fix) > segments_.segment(*flight_).last_s + options_.limits.max_ahead_s &&
      seconds(fix) > newest_s_ + options_.limits.max_ahead_s) {
    pending_ = fix;
    change.believed = false;
    return change;
  }
  Change now = process(fix);
  const bool believed = now.believed || now.rebuilt;
  join(change, std::move(now));
  change.believed = believed;
  return change;
}

LiveTrack::Change LiveTrack::process(const Fix& fix) {
  Known known{seconds(fix), fixed_place_m(fix), jump_sigma_m(fix), k_lesser, true};
  const auto mirror = std::ranges::lower_bound(all_, known.t_s, {}, &Known::t_s);
  if (mirror != all_.end() && mirror->t_s == known.t_s) return {};
  if (kind_ == TrackFrame::wgs84 && !frame_) {
    frame_.emplace(fix.position);
    origin_m_ = known.place_m;
  }
  TrackPose pose = pose_of(fix, std::nullopt, *epoch_);
  if (!pose.covariance_m2.allFinite()) return {};
  if (fix.fix >= options_.min_fix) {
    known.part = part_of(known);
    known.in_track = flight_ && known.part == *flight_;
  } else if (!poses_.empty() &&
             (in_frame(known.place_m) - poses_.back().position_m).norm() > options_.limits.max_distance_m) {
    ++counted_[std::string(to_string(FixRefusal::far_away))];
    Change change;
    change.believed = false;
    return change;
  }
  pose.position_m = in_frame(known.place_m);
  const std::size_t part = known.part;
  Change change = insert(std::move(known), std::move(pose));
  if (unsorted_ >= std::max(k_least_unsorted,
                            static_cast<std::size_t>(k_unsorted_share * static_cast<double>(all_.size())))) {
    join(change, assess_again());
  } else if (options_.origin && !origin_checked_ && flight_ &&
             segments_.segment(*flight_).n >= k_told_parts) {
    // Of another site, or mistyped: numbers of a hundred kilometres help nobody.
    origin_checked_ = true;
    if (!poses_.empty() && poses_.back().position_m.norm() > options_.limits.max_distance_m) {
      options_.origin.reset();
      join(change, take(*flight_));
    }
  } else if (part < k_apart && part != *flight_ &&
             static_cast<double>(segments_.segment(part).n) >
                 k_outgrown * static_cast<double>(segments_.segment(*flight_).n) + k_outgrown_more) {
    join(change, take(part));
  }
  return change;
}

std::size_t LiveTrack::part_of(Known& known) {
  const auto& limits = options_.limits;
  if (flight_) {
    const auto& flight = segments_.segment(*flight_);
    if (known.t_s > flight.last_s + limits.max_pause_s || known.t_s < flight.first_s - limits.max_pause_s) {
      ++unsorted_;
      return k_apart;
    }
    if (known.t_s < newest_s_) {
      ++unsorted_;
      return reaches(known) ? *flight_ : k_apart;
    }
  }
  const std::size_t part = segments_.add(known.t_s, known.place_m, known.sigma_m);
  newest_s_ = known.t_s;
  if (!flight_) flight_ = part;
  return part;
}

/// From its neighbours in the track, at the speed of the limits.
bool LiveTrack::reaches(const Known& known) const {
  const auto after = std::ranges::lower_bound(poses_, known.t_s, {}, &TrackPose::t_s);
  const Eigen::Vector3d at_m = in_frame(known.place_m);
  const auto near = [&](const TrackPose& pose) {
    return (pose.position_m - at_m).norm() <=
           options_.limits.max_speed_mps * std::abs(pose.t_s - known.t_s) + k_reach_m + 4 * known.sigma_m;
  };
  return (after == poses_.end() || near(*after)) && (after == poses_.begin() || near(*std::prev(after)));
}

LiveTrack::Change LiveTrack::insert(Known known, TrackPose pose) {
  Change change;
  const double t_s = known.t_s;
  const bool newest = known.part != k_apart && (all_.empty() || t_s >= newest_s_);
  const bool agrees =
      known.in_track || (known.part < k_apart && segments_.segment(known.part).n >= k_told_parts);
  if (newest && agrees) change.newest = pose;
  change.believed = agrees;
  if (known.in_track) {
    const auto place = std::ranges::lower_bound(poses_, t_s, {}, &TrackPose::t_s);
    const auto at = poses_.insert(place, std::move(pose));
    change.added = true;
    change.from_s = at == poses_.begin() ? t_s : std::prev(at)->t_s;
    change.to_s = std::next(at) == poses_.end() ? t_s : std::next(at)->t_s;
  } else {
    aside_.insert_or_assign(t_s, std::move(pose));
    count_aside(known, true);
  }
  ask_those_about(t_s);
  all_.insert(std::ranges::lower_bound(all_, t_s, {}, &Known::t_s), std::move(known));
  if (all_.size() > options_.max_poses) {
    const Known& oldest = all_.front();
    if (oldest.in_track) {
      poses_.pop_front();
    } else {
      aside_.erase(oldest.t_s);
      count_aside(oldest, false);
    }
    ask_those_about(oldest.t_s);
    all_.pop_front();
  }
  return change;
}

LiveTrack::Change LiveTrack::assess_again() {
  unsorted_ = 0;
  TrackSegments every(options_.limits);
  std::vector<Known*> good;
  for (Known& known : all_) {
    if (known.part != k_lesser) good.push_back(&known);
  }
  if (good.empty()) return {};
  for (const Known* known : good) every.add(known->t_s, known->place_m, known->sigma_m);
  const auto flight = every.segment(every.largest());
  // What is stamped for another day would keep everything of today from being the newest.
  TrackSegments near(options_.limits);
  for (Known* known : good) {
    const bool apart = known->t_s > flight.last_s + options_.limits.max_pause_s ||
                       known->t_s < flight.first_s - options_.limits.max_pause_s;
    known->part = apart ? k_apart : near.add(known->t_s, known->place_m, known->sigma_m);
    if (!apart) newest_s_ = known->t_s;
  }
  segments_ = std::move(near);
  const bool same = std::ranges::all_of(
      good, [&](const Known* known) { return known->in_track == (known->part == segments_.largest()); });
  flight_ = segments_.largest();
  if (!same) return take(*flight_);
  count_all_aside();
  return {};
}

/// This part is the flight from here on.
LiveTrack::Change LiveTrack::take(std::size_t part) {
  flight_ = part;
  std::map<double, TrackPose> known_poses = std::exchange(aside_, {});
  for (auto& pose : std::exchange(poses_, {})) {
    const double t_s = pose.t_s;
    known_poses.insert_or_assign(t_s, std::move(pose));
  }
  choose_frame();
  for (Known& known : all_) {
    const auto at = known_poses.find(known.t_s);
    if (at == known_poses.end()) continue;
    at->second.position_m = in_frame(known.place_m);
    const bool lesser =
        known.part == k_lesser && (!frame_ || at->second.position_m.norm() <= options_.limits.max_distance_m);
    known.in_track = lesser || known.part == part;
    if (known.in_track)
      poses_.push_back(std::move(at->second));
    else
      aside_.insert_or_assign(known.t_s, std::move(at->second));
  }
  count_all_aside();
  Change change;
  change.rebuilt = true;
  if (!poses_.empty()) change.newest = poses_.back();
  return change;
}

/// The middle of the flight, where nobody gave an origin.
void LiveTrack::choose_frame() {
  if (kind_ != TrackFrame::wgs84 || options_.origin) return;
  std::vector<Wgs84> places;
  for (const Known& known : all_) {
    if (known.part == *flight_) places.push_back(wgs84_from_ecef(known.place_m));
  }
  if (places.empty()) return;
  frame_.emplace(robust_centre(places));
  origin_m_ = ecef_from_wgs84(frame_->origin());
}

LiveTrack::Change LiveTrack::settle() {
  Change change;
  if (pending_) change = process(*std::exchange(pending_, std::nullopt));
  if (unsorted_ > 0)
    join(change, assess_again());
  else if (flight_ && segments_.largest() != *flight_)
    join(change, take(segments_.largest()));
  return change;
}

void LiveTrack::ask_again(std::size_t part, Aside& aside) {
  if (!aside.why) return;
  asked_[*std::exchange(aside.why, std::nullopt)] -= aside.n;
  unasked_.insert(part);
}

void LiveTrack::count_aside(const Known& known, bool more) {
  if (known.part == k_lesser) return;
  if (known.part == k_apart) {
    const auto at = std::ranges::lower_bound(apart_s_, known.t_s);
    if (more)
      apart_s_.insert(at, known.t_s);
    else if (at != apart_s_.end() && *at == known.t_s)
      apart_s_.erase(at);
    return;
  }
  const auto [aside, is_new] = aside_parts_.try_emplace(known.part);
  if (is_new) unasked_.insert(known.part);
  ask_again(known.part, aside->second);
  if (more)
    ++aside->second.n;
  else if (--aside->second.n == 0)
    aside_parts_.erase(aside);
}

void LiveTrack::ask_those_about(double t_s) {
  // Parts are numbered as they began; none reaches beyond the newest of them.
  if (t_s >= newest_s_) return;
  for (auto& [part, aside] : aside_parts_) {
    const auto& told = segments_.segment(part);
    if (told.first_s > t_s) break;
    if (told.last_s >= t_s) ask_again(part, aside);
  }
}

void LiveTrack::count_all_aside() {
  apart_s_.clear();
  aside_parts_.clear();
  unasked_.clear();
  asked_.clear();
  for (const Known& known : all_)
    if (!known.in_track) count_aside(known, true);
}

FixRefusal LiveTrack::why_aside(std::size_t part) const {
  const auto& told = segments_.segment(part);
  const auto between = std::ranges::upper_bound(all_, told.last_s, {}, &Known::t_s) -
                       std::ranges::lower_bound(all_, told.first_s, {}, &Known::t_s);
  return why_apart(told, segments_.segment(*flight_), options_.limits.max_pause_s,
                   static_cast<std::size_t>(between));
}

std::map<std::string, std::size_t> LiveTrack::refused() const {
  auto out = counted_;
  if (!flight_) return out;
  const auto add = [&](FixRefusal why, std::size_t n) {
    if (n > 0) out[std::string(to_string(why))] += n;
  };
  const auto& flight = segments_.segment(*flight_);
  // Of those of no part the first are too old, the last too new.
  const auto past = std::ranges::lower_bound(apart_s_, flight.first_s - options_.limits.max_pause_s);
  const auto future =
      std::ranges::upper_bound(past, apart_s_.end(), flight.last_s + options_.limits.max_pause_s);
  const auto late = std::ranges::lower_bound(past, future, newest_s_ - options_.limits.max_disorder_s);
  add(FixRefusal::past_stamp, static_cast<std::size_t>(past - apart_s_.begin()));
  add(FixRefusal::out_of_order, static_cast<std::size_t>(late - past));
  add(FixRefusal::jump, static_cast<std::size_t>(future - late));
  add(FixRefusal::future_stamp, static_cast<std::size_t>(apart_s_.end() - future));
  for (const std::size_t part : std::exchange(unasked_, {})) {
    const auto aside = aside_parts_.find(part);
    if (aside == aside_parts_.end() || aside->second.why) continue;
    const FixRefusal why = why_aside(part);
    if (why == FixRefusal::future_stamp || why == FixRefusal::past_stamp) {
      // As long as the flight has not come there.
      add(why, aside->second.n);
      unasked_.insert(part);
      continue;
    }
    aside->second.why = why;
    asked_[why] += aside->second.n;
  }
  for (const auto& [why, n] : asked_) add(why, n);
  return out;
}

}  // namespace anchord
