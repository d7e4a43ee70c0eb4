#include "core/geo/tag_track.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace anchord {
namespace {

/// A place known this badly says nothing of an anchor beside ranges that are good to a decimetre.
constexpr double k_most_missed_m = 0.5;

std::vector<TrackPose> good_enough(std::span<const TrackPose> poses, FixClass min_fix) {
  std::vector<TrackPose> good;
  std::ranges::copy_if(poses, std::back_inserter(good), [&](const TrackPose& p) { return p.fix >= min_fix; });
  return good;
}

}  // namespace

double default_sigma_m(FixClass fix) {
  // RTK promises 20 mm (dissertation 3.2.3, 7.2.3); the others are the usual orders of magnitude of their
  // class.
  switch (fix) {
    case FixClass::rtk_fixed:
      return 0.02;
    case FixClass::rtk_float:
      return 0.4;
    case FixClass::dgps:
      return 1.0;
    case FixClass::single:
      return 3.0;
    case FixClass::none:
      return 100.0;
  }
  return 100.0;
}

TrackPose pose_of(const Fix& fix, const std::optional<EnuFrame>& frame, UtcTime epoch) {
  TrackPose pose;
  pose.t_s = seconds_between(epoch, fix.time);
  pose.position_m =
      fix.frame == TrackFrame::wgs84 && frame ? frame->enu_from_wgs84(fix.position).m : fix.local_m;
  if (fix.enu_from_body) pose.attitude = fix.enu_from_body->normalized();
  const double sigma_m = default_sigma_m(fix.fix);
  pose.covariance_m2 = fix.covariance_m2.value_or(Eigen::Matrix3d::Identity() * sigma_m * sigma_m);
  pose.fix = fix.fix;
  return pose;
}

TagPoint interpolate(const TrackPose& before, const TrackPose& after, double t_s,
                     const Eigen::Vector3d& lever_arm_body_m) {
  const double interval_s = after.t_s - before.t_s;
  const double share = interval_s > 0 ? (t_s - before.t_s) / interval_s : 0.0;
  TagPoint point;
  point.covariance_m2 = (1.0 - share) * before.covariance_m2 + share * after.covariance_m2;
  Eigen::Vector3d arm_before(0, 0, lever_arm_body_m.z());
  Eigen::Vector3d arm_after = arm_before;
  Eigen::Vector3d arm = arm_before;
  if (before.attitude && after.attitude) {
    const Eigen::Quaterniond now = before.attitude->slerp(share, *after.attitude);
    point.body_up = now * Eigen::Vector3d::UnitZ();
    point.body_forward = now * Eigen::Vector3d::UnitX();
    point.body_left = now * Eigen::Vector3d::UnitY();
    arm = now * lever_arm_body_m;
    arm_before = *before.attitude * lever_arm_body_m;
    arm_after = *after.attitude * lever_arm_body_m;
  }
  point.position_m = (1.0 - share) * before.position_m + share * after.position_m + arm;
  if (interval_s > 0) {
    point.velocity_mps = (after.position_m + arm_after - before.position_m - arm_before) / interval_s;
  }
  return point;
}

TagTrack::TagTrack(std::span<const Fix> fixes, const std::optional<EnuFrame>& frame, UtcTime epoch,
                   const TrackOptions& options)
    : min_fix_(options.min_fix), max_gap_s_(options.max_gap_s) {
  poses_.reserve(fixes.size());
  for (const Fix& fix : fixes) {
    TrackPose pose = pose_of(fix, frame, epoch);
    if (!std::isfinite(pose.t_s) || !pose.position_m.allFinite() || !pose.covariance_m2.allFinite()) continue;
    poses_.push_back(std::move(pose));
  }
  std::ranges::stable_sort(poses_, [](const TrackPose& a, const TrackPose& b) {
    return a.t_s != b.t_s ? a.t_s < b.t_s
                          : a.fix > b.fix;  // the better of two at one instant comes first and stays
  });
  const auto mirrors = std::ranges::unique(poses_, {}, &TrackPose::t_s);
  poses_.erase(mirrors.begin(), mirrors.end());
  has_attitude_ = !poses_.empty() &&
                  std::ranges::all_of(poses_, [](const TrackPose& p) { return p.attitude.has_value(); });
  missed_ = InterpolationError(good_enough(poses_, min_fix_));
  index();
}

void TagTrack::index() {
  const std::size_t n = poses_.size();
  for (const TrackPose& pose : poses_) times_s_.push_back(pose.t_s);
  missed_midway_m_.assign(n, 0.0);
  for (std::size_t i = 1; i < n; ++i)
    missed_midway_m_[i] = missed_.sigma_m(times_s_[i] - times_s_[i - 1], 0.5);
  if (n < 2) return;
  const double span_s = (times_s_.back() - times_s_.front()) / static_cast<double>(n);
  spans_per_s_ = 1.0 / span_s;
  spans_.resize(n + 1);
  std::uint32_t pose = 0;
  for (std::size_t i = 0; i <= n; ++i) {
    while (pose < n && span_of(times_s_[pose]) < i) ++pose;
    spans_[i] = pose;
  }
}

std::size_t TagTrack::span_of(double t_s) const {
  const auto span = static_cast<std::int64_t>((t_s - times_s_.data()[0]) * spans_per_s_);
  return std::min(static_cast<std::size_t>(span), times_s_.size() - 1);
}

std::size_t TagTrack::after(double t_s) const {
  // Asked for every range in every round: no bounds are checked twice.
  const double* const times_s = times_s_.data();
  const std::size_t n = times_s_.size();
  if (n == 0 || t_s < times_s[0]) return 0;
  if (!(t_s < times_s[n - 1])) return n;
  const std::uint32_t* const span = spans_.data() + span_of(t_s);
  const double *from = times_s + span[0], *const to = times_s + span[1];
  constexpr std::ptrdiff_t k_few = 8;
  if (to - from > k_few) return static_cast<std::size_t>(std::upper_bound(from, to, t_s) - times_s);
  while (from < to && *from <= t_s) ++from;
  return static_cast<std::size_t>(from - times_s);
}

TrackInterval TagTrack::interval_at(double t_s) const {
  const std::size_t next = after(t_s);
  if (next == 0) return {.refused = TrackRefusal::outside};
  const TrackPose* const before = poses_.data() + (next - 1);
  if (next == times_s_.size()) {
    // The last epoch itself is not an extrapolation.
    if (before->t_s < t_s) return {.refused = TrackRefusal::outside};
    if (before->fix < min_fix_) return {.refused = TrackRefusal::fix_class};
    return {TrackRefusal::none, before, before, 0.0};
  }
  const double *const around_s = times_s_.data() + (next - 1), interval_s = around_s[1] - around_s[0];
  const double share = (t_s - around_s[0]) / interval_s;
  const double missed_m = 4.0 * share * (1.0 - share) * missed_midway_m_.data()[next];
  if (max_gap_s_ ? interval_s > *max_gap_s_ : missed_m > k_most_missed_m)
    return {.refused = TrackRefusal::gap};
  if (before[0].fix < min_fix_ || before[1].fix < min_fix_) return {.refused = TrackRefusal::fix_class};
  return {TrackRefusal::none, before, before + 1, missed_m};
}

TagPoint TagTrack::at(double t_s, const Eigen::Vector3d& lever_arm_body_m) const {
  const TrackInterval interval = interval_at(t_s);
  if (interval.refused != TrackRefusal::none) {
    TagPoint point;
    point.refused = interval.refused;
    return point;
  }
  TagPoint point = interpolate(*interval.before, *interval.later, t_s, lever_arm_body_m);
  point.covariance_m2.diagonal().array() += interval.missed_m * interval.missed_m;
  return point;
}

}  // namespace anchord
