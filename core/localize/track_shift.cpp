#include "core/localize/track_shift.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/base/median.hpp"
#include "core/localize/clock_text.hpp"
#include "core/localize/gates.hpp"
#include "core/localize/weighed_row.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr double k_gap_s = 1.0, k_gap_intervals = 5;
constexpr double k_old_s = 10.0;  // a base that is set up anew sends nothing for longer
constexpr double k_step_m = 0.2, k_usual_steps = 8;
constexpr double k_velocity_over_s = 0.2;
constexpr double k_part_s = 2.0;  // a shorter part between two breaks says nothing by itself
constexpr std::size_t k_most_breaks = 24;

constexpr double k_shift_sigma_m =
    1.0;  // of a shift, each axis: ambiguities and surveyed-in bases are off so
constexpr double k_shift_chance = 0.05;  // of a flight with breaks, before its ranges are asked
constexpr double k_probability =
    0.99;  // of a flight without a shift to pass; real ones, with gaps cut into them too, reach 10.9 of 15.7
// Beyond the limit the gate fails; below it the region reaches the place without the shift the more, the
// closer the shift comes. Less 2 ln n for the largest of n.
constexpr double k_doubted_chi2 = 3, k_believed_chi2 = 9;
constexpr std::size_t k_most_again = 8;  // shifts solved for again, the oddest first
constexpr int k_wide_rounds = 3, k_rounds = 8;

constexpr int k_own = 4, k_columns = k_own + k_shared_size + 1;
using ShiftSums =
    Eigen::Matrix<double, k_columns, k_columns>;  // products of (by_anchor, by_shared, residual)
using Shared3 = Eigen::Matrix<double, k_shared_size, 3>;
using Own3 = Eigen::Matrix<double, k_own, 3>;

std::vector<TrackPose> good_poses(const FlightRows& flight, FixClass min_fix) {
  std::vector<TrackPose> good;
  for (const TrackPose& pose : flight.track.poses())
    if (pose.fix >= min_fix) good.push_back(pose);
  return good;
}

double usual_interval_s(const std::vector<TrackPose>& good) {
  std::vector<double> intervals_s;
  for (std::size_t i = 1; i < good.size(); ++i) intervals_s.push_back(good[i].t_s - good[i - 1].t_s);
  return upper_median(intervals_s);
}

void find_gaps(const FlightRows& flight, const std::vector<TrackPose>& good, double usual_s, FixClass min_fix,
               std::vector<TrackBreak>& breaks) {
  const double long_s = std::max(k_gap_s, k_gap_intervals * usual_s);
  for (std::size_t i = 1; i < good.size(); ++i) {
    const double from_s = good[i - 1].t_s, to_s = good[i].t_s;
    const auto between = std::ranges::upper_bound(flight.track.poses(), from_s, {}, &TrackPose::t_s);
    const bool lost = between != flight.track.poses().end() && between->t_s < to_s && between->fix < min_fix;
    if (lost || to_s - from_s > long_s) breaks.push_back({TrackBreak::Kind::gap, from_s, to_s});
  }
}

void find_old_corrections(const FlightRows& flight, std::span<const Fix> fixes, FixClass min_fix,
                          std::vector<TrackBreak>& breaks) {
  struct Age {
    double t_s{}, age_s{};
  };
  std::vector<Age> ages;
  for (const Fix& fix : fixes)
    if (fix.fix >= min_fix && fix.correction_age_s)
      ages.push_back({seconds_between(flight.epoch, fix.time), *fix.correction_age_s});
  std::ranges::stable_sort(ages, {}, &Age::t_s);
  for (std::size_t i = 1; i < ages.size(); ++i)
    if (ages[i - 1].age_s > k_old_s && ages[i].age_s <= k_old_s)
      breaks.push_back({TrackBreak::Kind::corrections, ages[i - 1].t_s, ages[i].t_s});
}

/// Of the positions i - 1 and i what the velocities before and after do not explain; the mean of both, so
/// that neither speed nor acceleration counts.
std::optional<double> unexplained_m(const std::vector<TrackPose>& good, std::size_t i, std::size_t over,
                                    double usual_s) {
  if (i < over + 1 || i + over >= good.size()) return std::nullopt;
  const double span_s = good[i + over].t_s - good[i - 1 - over].t_s;
  if (span_s > 2 * usual_s * static_cast<double>(2 * over + 1)) return std::nullopt;  // over a gap
  const auto velocity = [&](std::size_t from, std::size_t to) -> Eigen::Vector3d {
    return (good[to].position_m - good[from].position_m) / (good[to].t_s - good[from].t_s);
  };
  const Eigen::Vector3d mean_mps = 0.5 * (velocity(i - 1 - over, i - 1) + velocity(i, i + over));
  return (good[i].position_m - good[i - 1].position_m - mean_mps * (good[i].t_s - good[i - 1].t_s)).norm();
}

void find_jumps(const std::vector<TrackPose>& good, double usual_s, std::vector<TrackBreak>& breaks) {
  const auto over = static_cast<std::size_t>(std::max(1.0, std::ceil(k_velocity_over_s / usual_s - 1e-6)));
  std::vector<double> steps_m(good.size(), 0.0), seen_m;
  for (std::size_t i = 1; i < good.size(); ++i) {
    if (const auto step_m = unexplained_m(good, i, over, usual_s)) {
      steps_m[i] = *step_m;
      seen_m.push_back(*step_m);
    }
  }
  if (seen_m.empty()) return;
  const double least_m = std::max(k_step_m, k_usual_steps * upper_median(seen_m));
  for (std::size_t i = 1; i < good.size(); ++i) {
    if (steps_m[i] < least_m) continue;
    const std::size_t from = i > over ? i - over : 0, to = std::min(i + over + 1, good.size());
    if (std::ranges::max_element(steps_m.begin() + static_cast<std::ptrdiff_t>(from),
                                 steps_m.begin() + static_cast<std::ptrdiff_t>(to)) ==
        steps_m.begin() + static_cast<std::ptrdiff_t>(i))
      breaks.push_back({TrackBreak::Kind::jump, good[i - 1].t_s, good[i].t_s});
  }
}

std::vector<TrackBreak> merged(const std::vector<TrackBreak>& breaks, double part_s) {
  std::vector<TrackBreak> out;
  for (const TrackBreak& one : breaks) {
    if (out.empty() || one.from_s - out.back().to_s >= part_s)
      out.push_back(one);
    else
      out.back().to_s = std::max(out.back().to_s, one.to_s);
  }
  return out;
}

/// The parts from `first` to before `last`, taken as shifted.
struct Shifted {
  std::size_t first{}, last{};
  bool has(std::size_t part) const { return part >= first && part < last; }
};

/// Where the unknowns are taken to be, and how the ranges are weighed there.
struct Trial {
  JointState state;
  Shifted parts{};
  Eigen::Vector3d shift_m{0, 0, 0};  ///< where those parts truly were, less where the track has them
  std::vector<double> scales_m{};    ///< of the residuals of each anchor
  bool wide{true};                   ///< large residuals count less; else as in the fit, some not at all
};

/// As in the fit, or, wide, as if no residual were an outlier: a shift makes them large.
WeighedRow weighed(const JointRow& row, const JointLine& line, const AnchorBlock& block, double scale_m,
                   bool wide, const FlightOptions& options) {
  if (!wide || row.error_model) return weighed_row(row, line, block, scale_m, options);
  const double variance_m2 = row_variance_m2(line, block, scale_m);
  const double over = std::abs(line.residual_m) / (std::sqrt(variance_m2) * k_wide_scales);
  return {(over <= 1 ? 1.0 : 1.0 / (over * over)) / (variance_m2 * block.kappa), line.residual_m};
}

/// One anchor: its sums by part of the track, and its normal equations with its priors.
struct AnchorParts {
  std::vector<ShiftSums> parts{};
  ShiftSums all{ShiftSums::Zero()};
  Eigen::Matrix4d own_inverse{Eigen::Matrix4d::Zero()};
  Eigen::Vector4d gradient{Eigen::Vector4d::Zero()};
  Eigen::Matrix<double, k_own, k_shared_size> shared{Eigen::Matrix<double, k_own, k_shared_size>::Zero()};
  double scale_m{};  ///< of the residuals where they were taken
};

class ShiftTest {
 public:
  struct Given {
    const FlightRows& flight;
    std::span<const TrackBreak> breaks;
    const JointFit& fit;
    const SharedPrior& prior;
    const FlightOptions& options;
  };
  ShiftTest(const Given& given, const Trial& trial);
  /// What the flight says about one shift, from where the trial has it.
  struct Answer {
    Shifted parts;
    Eigen::Matrix3d information_per_m2{Eigen::Matrix3d::Zero()};
    Eigen::Vector3d shift_m{0, 0, 0};  ///< with the prior of a shift
    Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};
    double chi2{};
    double doubt{};  ///< 0..1: how much of it the regions hold
    double right{};  ///< chance that these parts are the right ones, should it be there
    std::vector<Eigen::Matrix3d>
        moved_per_m{};  ///< how the anchors of the fit, which has no shift, follow one
  };
  Answer ask(const Shifted& parts) const;
  /// The trial after one Gauss-Newton step of everything, the shift of its parts too.
  Trial step() const;

 private:
  AnchorParts parts_of(std::size_t index) const;
  /// The shift of some parts in the normal equations, everything else eliminated.
  struct Column {
    std::vector<Own3> own{};
    Shared3 by_shared{Shared3::Zero()};
    Eigen::Matrix3d information_per_m2{Eigen::Matrix3d::Zero()};
    Eigen::Vector3d score{0, 0, 0};
  };
  Column column_of(const Shifted& parts) const;

  Given given_;
  const Trial& trial_;
  std::vector<AnchorParts> anchors_;
  SharedVector gradient_;
  Eigen::LDLT<SharedMatrix> shared_;
};
using Answer = ShiftTest::Answer;

AnchorParts ShiftTest::parts_of(std::size_t index) const {
  const auto& [flight, breaks, fit, prior, options] = given_;
  const JointState::Anchor& anchor = trial_.state.anchors[index];
  // Antennas that were elsewhere by a vector measure an anchor that is elsewhere by its opposite.
  JointState::Anchor seen_from_shifted = anchor;
  seen_from_shifted.position_m -= trial_.shift_m;
  const AnchorBlock& block = fit.normal.anchors[index];
  struct ShiftLine {
    const JointRow* row;
    JointLine at;
    std::size_t part;
  };
  std::vector<ShiftLine> lines;
  std::vector<double> sizes_m;
  for (const JointRow& row : flight.anchors[index].rows) {
    const double at_s = row.t_s + trial_.state.shared[k_shared_lag];
    // Between the two positions of a break a range belongs to the nearer.
    const auto part = static_cast<std::size_t>(
        std::ranges::count_if(breaks, [&](const TrackBreak& b) { return at_s > 0.5 * (b.from_s + b.to_s); }));
    JointLine line = linearise(flight.track, row, trial_.state.shared,
                               trial_.parts.has(part) ? seen_from_shifted : anchor);
    if (line.refused != TrackRefusal::none) continue;
    if (!row.error_model) sizes_m.push_back(std::abs(line.residual_m));
    lines.push_back({&row, std::move(line), part});
  }
  AnchorParts out;
  out.parts.assign(breaks.size() + 1, ShiftSums::Zero());
  out.scale_m =
      sizes_m.empty() ? block.scale_m : std::max(1.4826 * upper_median(sizes_m), options.min_scale_m);
  for (const ShiftLine& line : lines) {
    const WeighedRow by = weighed(*line.row, line.at, block, trial_.scales_m[index], trial_.wide, options);
    Eigen::Matrix<double, k_columns, 1> columns;
    columns << line.at.by_anchor, line.at.by_shared, by.residual_m;
    out.parts[line.part].noalias() += by.per_m2 * columns * columns.transpose();
  }
  for (const ShiftSums& part : out.parts) out.all += part;
  out.shared = out.all.block<k_own, k_shared_size>(0, k_own);
  if (options.dims == Dims::two) out.shared.row(2).setZero();
  out.gradient = out.all.topRightCorner<k_own, 1>();
  out.own_inverse = add_anchor_priors(flight.anchors[index].id, anchor, options,
                                      out.all.topLeftCorner<k_own, k_own>(), out.gradient);
  return out;
}

ShiftTest::ShiftTest(const Given& given, const Trial& trial) : given_(given), trial_(trial) {
  SharedMatrix shared = given.prior.information;
  gradient_ = given.prior.information * (given.prior.mean - trial.state.shared);
  for (std::size_t i = 0; i < trial.state.anchors.size(); ++i) {
    if (!trial.state.anchors[i].active) {
      anchors_.emplace_back();
      continue;
    }
    const AnchorParts& anchor = anchors_.emplace_back(parts_of(i));
    shared += anchor.all.block<k_shared_size, k_shared_size>(k_own, k_own) -
              anchor.shared.transpose() * anchor.own_inverse * anchor.shared;
    gradient_ += anchor.all.block<k_shared_size, 1>(k_own, k_columns - 1) -
                 anchor.shared.transpose() * anchor.own_inverse * anchor.gradient;
  }
  shared_.compute(shared);
}

ShiftTest::Column ShiftTest::column_of(const Shifted& parts) const {
  Column out;
  Shared3 with_shared = Shared3::Zero();
  for (const AnchorParts& anchor : anchors_) {
    ShiftSums sums = ShiftSums::Zero();
    for (std::size_t k = 0; k < anchor.parts.size(); ++k)
      if (parts.has(k)) sums += anchor.parts[k];
    Own3 own = -sums.topLeftCorner<k_own, 3>();
    if (given_.options.dims == Dims::two) own.row(2).setZero();
    const Own3 solved = anchor.own_inverse * own;
    out.information_per_m2 += sums.topLeftCorner<3, 3>() - own.transpose() * solved;
    out.score += -sums.block<3, 1>(0, k_columns - 1) - solved.transpose() * anchor.gradient;
    with_shared += -sums.block<k_shared_size, 3>(k_own, 0) - anchor.shared.transpose() * solved;
    out.own.push_back(own);
  }
  out.by_shared = shared_.solve(with_shared);
  out.information_per_m2 -= with_shared.transpose() * out.by_shared;
  out.score -= out.by_shared.transpose() * gradient_;
  return out;
}

Answer ShiftTest::ask(const Shifted& parts) const {
  const Column column = column_of(parts);
  Answer out{parts};
  out.information_per_m2 = column.information_per_m2;
  for (std::size_t i = 0; i < anchors_.size(); ++i)
    out.moved_per_m.emplace_back(
        (anchors_[i].own_inverse * (column.own[i] - anchors_[i].shared * column.by_shared)).topRows<3>());
  // What was found so far and what is left, against the prior of the whole.
  const Eigen::Vector3d score = column.score + column.information_per_m2 * trial_.shift_m;
  const Eigen::Matrix3d before = Eigen::Matrix3d::Identity() / (k_shift_sigma_m * k_shift_sigma_m);
  out.covariance_m2 = (out.information_per_m2 + before).inverse();
  out.shift_m = out.covariance_m2 * score;
  out.chi2 = score.dot(out.shift_m);
  return out;
}

Trial ShiftTest::step() const {
  const Column column = column_of(trial_.parts);
  const Eigen::Matrix3d before = Eigen::Matrix3d::Identity() / (k_shift_sigma_m * k_shift_sigma_m);
  const Eigen::Vector3d shift_m =
      (column.information_per_m2 + before).ldlt().solve(column.score - before * trial_.shift_m);
  const SharedVector shared = shared_.solve(gradient_) - column.by_shared * shift_m;
  Trial out = trial_;
  out.shift_m += shift_m;
  out.state.shared += shared;
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const AnchorParts& anchor = anchors_[i];
    if (!out.state.anchors[i].active) continue;
    Eigen::Vector4d own =
        anchor.own_inverse * (anchor.gradient - column.own[i] * shift_m - anchor.shared * shared);
    own *= std::min(1.0, 1.0 / std::max(own.head<3>().norm(), 1e-9));
    out.state.anchors[i].position_m += own.head<3>();
    out.state.anchors[i].delay_m += own[3];
    out.scales_m[i] = anchor.scale_m;
  }
  return out;
}

/// A shift that only looks odd, solved for again together with everything else: its misfit hides in the
/// residual scale, and in ranges that the fit took for outliers.
void solve_again(const ShiftTest::Given& given, Trial trial, Answer& answer) {
  trial.parts = answer.parts;
  trial.shift_m = answer.shift_m;
  for (int round = 0; round < k_wide_rounds + k_rounds; ++round) {
    trial.wide = round < k_wide_rounds;
    trial = ShiftTest(given, trial).step();
    if (!trial.shift_m.allFinite()) return;
  }
  Answer again = ShiftTest(given, trial).ask(answer.parts);
  if (!std::isfinite(again.chi2) || again.chi2 < answer.chi2) return;
  again.moved_per_m = std::move(answer.moved_per_m);  // those of the fit, whose answer is claimed
  answer = std::move(again);
}

/// Time in which the parts have ranges, and the rest of the flight has.
struct Durations {
  double in_s{}, outside_s{};
};
Durations durations_of(const FlightRows& flight, std::span<const TrackBreak> breaks, const Shifted& parts) {
  double first_s = std::numeric_limits<double>::infinity(), last_s = -first_s;
  for (const AnchorRows& anchor : flight.anchors) {
    if (anchor.rows.empty()) continue;
    first_s = std::min(first_s, anchor.rows.front().t_s);
    last_s = std::max(last_s, anchor.rows.back().t_s);
  }
  const auto poses = flight.track.poses();
  first_s = std::max(first_s, poses.front().t_s);
  last_s = std::min(last_s, poses.back().t_s);
  Durations out;
  for (std::size_t k = 0; k <= breaks.size(); ++k) {
    const double from_s = k > 0 ? std::max(breaks[k - 1].to_s, first_s) : first_s;
    const double to_s = k < breaks.size() ? std::min(breaks[k].from_s, last_s) : last_s;
    (parts.has(k) ? out.in_s : out.outside_s) += std::max(to_s - from_s, 0.0);
  }
  return out;
}

/// Nothing known: errors that stay alike for as long as the parts last are a shift to this test.
void forget(Answer& answer) {
  answer.information_per_m2.setZero();
  answer.shift_m.setZero();
  answer.covariance_m2 = Eigen::Matrix3d::Identity() * k_shift_sigma_m * k_shift_sigma_m;
  answer.chi2 = 0;
}

/// How much of every shift the regions hold: the chance that it is there, each as likely before, or more
/// where the ranges come near to showing it.
void find_doubts(std::vector<Answer>& answers) {
  const double n = static_cast<double>(answers.size()), each = k_shift_chance / n;
  double sum = 1.0 - k_shift_chance;
  for (Answer& answer : answers) {
    // Likelihood with the shift over that without; no exponential overflows.
    const double narrower = answer.covariance_m2.determinant() / std::pow(k_shift_sigma_m, 6);
    answer.doubt = each * std::sqrt(std::max(narrower, 0.0)) * std::exp(0.5 * std::min(answer.chi2, 200.0));
    sum += answer.doubt;
  }
  for (Answer& answer : answers) {
    const double near = std::clamp(
        (answer.chi2 - k_doubted_chi2 - 2 * std::log(n)) / (k_believed_chi2 - k_doubted_chi2), 0.0, 1.0);
    answer.doubt = std::max(answer.doubt / sum, near * near);
  }
}

/// Mean square of what an anchor is off by a shift; the longer part of the flight is likelier the right one.
Eigen::Matrix3d off_m2(const Answer& answer, std::size_t anchor) {
  const Eigen::Matrix3d square = answer.shift_m * answer.shift_m.transpose() + answer.covariance_m2;
  const Eigen::Matrix3d& moved = answer.moved_per_m[anchor];
  const Eigen::Matrix3d other = moved + Eigen::Matrix3d::Identity();
  return answer.doubt * ((1.0 - answer.right) * moved * square * moved.transpose() +
                         answer.right * other * square * other.transpose());
}

std::string after_what(const TrackBreak& where) {
  char text[120];
  const double s = where.to_s - where.from_s;
  switch (where.kind) {
    case TrackBreak::Kind::gap:
      std::snprintf(text, sizeof text, "after %.1f s without a good position", s);
      break;
    case TrackBreak::Kind::corrections:
      std::snprintf(text, sizeof text, "where the corrections came back after more than %.0f s", k_old_s);
      break;
    case TrackBreak::Kind::jump:
      std::snprintf(text, sizeof text, "where it steps between two positions %.1f s apart", s);
      break;
  }
  return text;
}

std::string mostly(const Eigen::Vector3d& shift_m) {
  return std::abs(shift_m.z()) > shift_m.head<2>().norm() ? "mostly in height" : "mostly horizontally";
}

std::string since(const FlightRows& flight, std::span<const TrackBreak> breaks, const Shifted& parts) {
  const TrackBreak& where = breaks[parts.first - 1];
  std::string text = "from " + clock_text(flight, where.to_s);
  if (parts.last <= breaks.size())
    return text + " to " + clock_text(flight, breaks[parts.last - 1].from_s) + " UTC";
  return text + " UTC on, " + after_what(where);
}

std::string why(const FlightRows& flight, std::span<const TrackBreak> breaks, const Answer& worst,
                bool passed) {
  char text[400];
  if (passed)
    std::snprintf(
        text, sizeof text,
        "the ranges of all anchors together show no shift of the track at its gaps and steps (%zu); the "
        "largest they would allow is %.2f m, %s, %s: chi2 %.1f",
        breaks.size(), worst.shift_m.norm(), mostly(worst.shift_m).c_str(),
        since(flight, breaks, worst.parts).c_str(), worst.chi2);
  else
    std::snprintf(text, sizeof text,
                  "the track is shifted by about %.2f m, %s, %s: the receiver fixed with wrong ambiguities, "
                  "or its base position changed (chi2 %.1f over the ranges of all anchors); exclude the "
                  "positions before or after "
                  "it, whichever had the wrong fix or base, or fly again",
                  worst.shift_m.norm(), mostly(worst.shift_m).c_str(),
                  since(flight, breaks, worst.parts).c_str(), worst.chi2);
  return text;
}

/// The shift that takes most from the anchors' accuracy, and how large it may be before the gate sees it.
std::string unseen(const FlightRows& flight, std::span<const TrackBreak> breaks,
                   std::span<const Answer> answers, std::size_t n_wider, double limit) {
  const auto taken_m2 = [](const Answer& answer) {
    double sum_m2 = 0;
    for (std::size_t i = 0; i < answer.moved_per_m.size(); ++i) sum_m2 += off_m2(answer, i).trace();
    return sum_m2;
  };
  const Answer& worst = *std::ranges::max_element(answers, {}, taken_m2);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(worst.information_per_m2);
  const double least_m = std::sqrt(limit / std::max(axes.eigenvalues()[0], 1e-12));
  char size[40] = "several metres";
  if (least_m < 10) std::snprintf(size, sizeof size, "%.1f m", least_m);
  return std::to_string(n_wider) + " of " + std::to_string(flight.anchors.size()) +
         " anchors are less certain because the track may be shifted " + since(flight, breaks, worst.parts) +
         ": a shift of up to " + size + " would not show in the ranges";
}

}  // namespace

std::vector<TrackBreak> track_breaks(const FlightRows& flight, std::span<const Fix> fixes, FixClass min_fix) {
  const std::vector<TrackPose> good = good_poses(flight, min_fix);
  std::vector<TrackBreak> breaks;
  if (good.size() < 2) return breaks;
  const double usual_s = usual_interval_s(good);
  find_gaps(flight, good, usual_s, min_fix, breaks);
  find_old_corrections(flight, fixes, min_fix, breaks);
  find_jumps(good, usual_s, breaks);
  std::ranges::stable_sort(breaks, {}, &TrackBreak::from_s);
  double part_s = k_part_s;
  std::vector<TrackBreak> out = merged(breaks, part_s);
  while (out.size() > k_most_breaks) out = merged(breaks, part_s *= 1.5);
  return out;
}

std::optional<TrackShift> check_track_shift(const FlightRows& flight, std::span<const TrackBreak> breaks,
                                            const JointFit& fit, const SharedPrior& prior,
                                            const FlightOptions& options) {
  if (breaks.empty()) return std::nullopt;
  const ShiftTest::Given given{flight, breaks, fit, prior, options};
  Trial trial{fit.state};
  for (const AnchorBlock& block : fit.normal.anchors) trial.scales_m.push_back(block.scale_m);
  const ShiftTest test(given, trial);
  std::vector<Answer> answers;
  for (std::size_t k = 1; k <= breaks.size(); ++k) {
    answers.push_back(test.ask({k, breaks.size() + 1}));
    if (k < breaks.size()) answers.push_back(test.ask({k, k + 1}));
  }
  std::ranges::stable_sort(answers, std::ranges::greater{}, &Answer::chi2);
  std::size_t n_again = 0;
  for (Answer& answer : answers) {
    const auto [in_s, outside_s] = durations_of(flight, breaks, answer.parts);
    // A wrong fix does not last: the longer, the likelier the right one.
    answer.right = in_s * in_s / std::max(in_s * in_s + outside_s * outside_s, 1e-9);
    if (std::min(in_s, outside_s) < 2 * options.correlation_s)
      forget(answer);
    else if (n_again++ < k_most_again)
      solve_again(given, trial, answer);
  }
  find_doubts(answers);
  const Answer& worst = *std::ranges::max_element(answers, {}, &Answer::chi2);
  const double limit = chi2_quantile(1.0 - (1.0 - k_probability) / static_cast<double>(answers.size()), 3);
  const bool passed = worst.chi2 <= limit;
  TrackShift out{{"track_shift", worst.chi2, limit, passed, why(flight, breaks, worst, passed)}};
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    Eigen::Matrix4d doubt_m2 = Eigen::Matrix4d::Zero();
    for (const Answer& answer : answers) doubt_m2.topLeftCorner<3, 3>() += off_m2(answer, i);
    if (options.dims == Dims::two) {
      doubt_m2.row(2).setZero();
      doubt_m2.col(2).setZero();
    }
    const Eigen::Matrix4d& before_m2 = fit.anchor_covariance[i];
    n_wider +=
        fit.state.anchors[i].active && much_wider(before_m2 + doubt_m2, before_m2, options.dims) ? 1 : 0;
    out.covariance_m2.emplace_back(doubt_m2.topLeftCorner<3, 3>());
  }
  if (passed && n_wider > 0) out.note = unseen(flight, breaks, answers, n_wider, limit);
  return out;
}

}  // namespace anchord
