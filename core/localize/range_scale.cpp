#include "core/localize/range_scale.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/localize/weighed_row.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr double k_prior = 0.05;        // of s, one sigma: 2 to 10 % are what wrong clocks and units do
constexpr double k_near_m = 5.0;        // below, ranges of real radios have a slope of their own,
constexpr double k_near_right_m = 2.5;  // right at about this distance,
constexpr double k_near_prior = 0.06;   // by so many metres a metre, one sigma
constexpr double k_failing_z = 4.0;
constexpr double k_failing = 0.005;  // less moves no anchor out of its region
constexpr double k_odd_z = 1.5;      // worth another solve
constexpr std::size_t k_most_again = 2;
constexpr int k_rounds = 3;
constexpr double k_wide_scales = 3;         // beyond, a residual counts less: a factor makes them large
constexpr double k_imitated_bias_m = 0.15;  // no factor is shown by ranges that only differ from a known bias
constexpr double k_chance_all = 0.07;  // of a flight to have a factor on all ranges, before they are asked
constexpr double k_chance = 0.05;      // on some of them
// As of a shift of the track.
constexpr double k_doubted_chi2 = 3, k_believed_chi2 = 9;

// One range in the normal equations: by_anchor, by_shared, slope of near ranges, factor, residual.
constexpr int k_own = 4, k_near = k_shared_size, k_factor = k_near + 1, k_residual = k_factor + 1,
              k_rest = k_residual + 1;
using Sums = Eigen::Matrix<double, k_own + k_rest, k_own + k_rest>;
using Rest = Eigen::Matrix<double, k_rest, k_rest>;
using Coupling = Eigen::Matrix<double, k_own, k_rest>;

/// Ranges that may have one factor: all, or those of one antenna, or of one anchor.
struct Group {
  std::optional<std::size_t> antenna{}, anchor{};
  bool all() const { return !anchor && !antenna; }
  bool has(std::size_t of_anchor, std::size_t of_antenna) const {
    return (!anchor || *anchor == of_anchor) && (!antenna || *antenna == of_antenna);
  }
};

std::size_t antenna_of(const FlightRows& flight, const JointRow& row) {
  const auto at = std::ranges::find_if(flight.antennas, [&](const FlightAntenna& one) {
    return one.tag == row.tag && one.antenna == row.antenna;
  });
  return static_cast<std::size_t>(at - flight.antennas.begin());
}

std::vector<Group> groups_of(const FlightRows& flight, const JointFit& fit) {
  std::vector<Group> groups{Group{}};
  for (std::size_t k = 0; flight.antennas.size() > 1 && k < flight.antennas.size(); ++k)
    groups.push_back({.antenna = k});
  for (std::size_t i = 0; i < flight.anchors.size(); ++i)
    if (fit.state.anchors[i].active) groups.push_back({.anchor = i});
  return groups;
}

/// How residuals count: as in the fit, or large ones less, but all of them: what a factor makes of ranges the
/// fit may have taken for outliers.
enum class Weighing : std::uint8_t { as_fitted, wide };

/// What the flight says about the factor of one group.
struct Answer {
  Group group;
  ScaleFinding found;
  std::vector<Eigen::Vector3d>
      moved{};     ///< how the anchors of the fit, which has no factor, follow s; metres
  double doubt{};  ///< 0..1: how much of it the regions hold
};

/// The normal equations of a fit, to ask them for factors.
class ScaleTest {
 public:
  struct Given {
    const FlightRows& flight;
    const JointFit& fit;
    const SharedPrior& prior;
    const FlightOptions& options;
  };
  ScaleTest(const Given& given, Weighing weighing);
  /// since  what the rows were divided by already, less one: the prior is about the whole
  Answer ask(const Group& group, double since = 0) const;

 private:
  struct Anchor {
    std::vector<Sums> by_antenna{};
    Eigen::Matrix4d own_inverse{Eigen::Matrix4d::Zero()};
    Eigen::Vector4d prior_gradient{Eigen::Vector4d::Zero()};
  };
  Anchor anchor_of(std::size_t index, Weighing weighing) const;
  Sums sums_of(std::size_t anchor, const Group& group) const;

  Given given_;
  std::vector<Anchor> anchors_;
};

double weight_per_m2(const WeighedRow& by, const JointRow& row, const JointLine& line,
                     const AnchorBlock& block, Weighing weighing) {
  if (weighing == Weighing::as_fitted || row.error_model) return by.per_m2;
  const double variance_m2 = row_variance_m2(line, block, block.scale_m);
  const double over2 = line.residual_m * line.residual_m / (k_wide_scales * k_wide_scales * variance_m2);
  return (over2 <= 1 ? 1.0 : 1.0 / over2) / (variance_m2 * block.kappa);
}

ScaleTest::Anchor ScaleTest::anchor_of(std::size_t index, Weighing weighing) const {
  const auto& [flight, fit, prior, options] = given_;
  const JointState::Anchor& anchor = fit.state.anchors[index];
  const AnchorBlock& block = fit.normal.anchors[index];
  Anchor out;
  out.by_antenna.assign(flight.antennas.size() + 1, Sums::Zero());
  if (!anchor.active) return out;
  for (const JointRow& row : flight.anchors[index].rows) {
    const JointLine line = linearise(flight.track, row, fit.state.shared, anchor);
    if (line.refused != TrackRefusal::none) continue;
    const WeighedRow by = weighed_row(row, line, block, block.scale_m, options);
    const double weight = weight_per_m2(by, row, line, block, weighing);
    if (!(weight > 0)) continue;
    const double distance_m = (line.antenna_m - anchor.position_m).norm();
    Eigen::Matrix<double, k_own + k_rest, 1> columns;
    columns << line.by_anchor, line.by_shared, std::min(distance_m, k_near_m) - k_near_right_m, distance_m,
        by.residual_m;
    out.by_antenna[antenna_of(flight, row)].noalias() += weight * columns * columns.transpose();
  }
  Eigen::Matrix4d own = Eigen::Matrix4d::Zero();
  for (const Sums& sums : out.by_antenna) own += sums.topLeftCorner<k_own, k_own>();
  const double delay_information = 1.0 / (options.delay_prior_m * options.delay_prior_m);
  own(3, 3) += delay_information;
  out.prior_gradient[3] -= delay_information * anchor.delay_m;
  const PriorNormal place = prior_normal(priors_of(flight.anchors[index].id, options), options.outline_m,
                                         options.outline_sigma_m, anchor.position_m);
  own.topLeftCorner<3, 3>() += place.information;
  out.prior_gradient.head<3>() += place.gradient;
  if (options.dims == Dims::two) {
    own.row(2).setZero();
    own.col(2).setZero();
    own(2, 2) = 1.0;
  }
  // A direction no range sees, as in build_normal.
  own.topLeftCorner<3, 3>().diagonal().array() +=
      1e-6 * own.topLeftCorner<3, 3>().diagonal().maxCoeff() + 1e-12;
  out.own_inverse = own.ldlt().solve(Eigen::Matrix4d::Identity());
  return out;
}

ScaleTest::ScaleTest(const Given& given, Weighing weighing) : given_(given) {
  for (std::size_t i = 0; i < given.flight.anchors.size(); ++i) anchors_.push_back(anchor_of(i, weighing));
}

/// Of one anchor; where the group has no part, the factor has none.
Sums ScaleTest::sums_of(std::size_t anchor, const Group& group) const {
  Sums all = Sums::Zero();
  for (std::size_t k = 0; k < anchors_[anchor].by_antenna.size(); ++k) {
    Sums sums = anchors_[anchor].by_antenna[k];
    if (!group.has(anchor, k)) {
      sums.row(k_own + k_factor).setZero();
      sums.col(k_own + k_factor).setZero();
    }
    all += sums;
  }
  return all;
}

/// A prior that takes the kit for calibrated would make a factor of what a bias is.
SharedPrior with_open_bias(SharedPrior prior) {
  SharedMatrix covariance = prior.information.inverse();
  covariance(k_shared_bias, k_shared_bias) += k_imitated_bias_m * k_imitated_bias_m;
  prior.information = covariance.inverse();
  return prior;
}

Answer ScaleTest::ask(const Group& group, double since) const {
  const SharedPrior prior = with_open_bias(given_.prior);
  Rest rest = Rest::Zero();
  std::vector<Coupling> couplings;
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const Sums sums = sums_of(i, group);
    Coupling& coupling = couplings.emplace_back(sums.topRightCorner<k_own, k_rest>());
    coupling.col(k_residual) += anchors_[i].prior_gradient;
    if (given_.options.dims == Dims::two) coupling.row(2).setZero();
    rest +=
        sums.bottomRightCorner<k_rest, k_rest>() - coupling.transpose() * anchors_[i].own_inverse * coupling;
  }
  rest.topLeftCorner<k_shared_size, k_shared_size>() += prior.information;
  rest.block<k_shared_size, 1>(0, k_residual) += prior.information * (prior.mean - given_.fit.state.shared);
  rest(k_near, k_near) += 1.0 / (k_near_prior * k_near_prior);
  const Eigen::Matrix<double, k_factor, 1> with = rest.block<k_factor, 1>(0, k_factor);
  const Eigen::Matrix<double, k_factor, 1> followed =
      rest.topLeftCorner<k_factor, k_factor>().ldlt().solve(with);
  const double information = std::max(rest(k_factor, k_factor) - with.dot(followed), 0.0);
  const double score =
      rest(k_factor, k_residual) - followed.dot(rest.block<k_factor, 1>(0, k_residual)) + information * since;
  const double with_prior = information + 1.0 / (k_prior * k_prior);
  Answer out;
  out.group = group;
  out.found = {score / with_prior, 1.0 / std::sqrt(with_prior), score / std::sqrt(with_prior)};
  // The fit followed a factor with the prior it has, and without a slope.
  rest.topLeftCorner<k_shared_size, k_shared_size>() += given_.prior.information - prior.information;
  const SharedVector shared =
      rest.topLeftCorner<k_shared_size, k_shared_size>().ldlt().solve(with.head<k_shared_size>());
  for (std::size_t i = 0; i < anchors_.size(); ++i)
    out.moved.emplace_back((anchors_[i].own_inverse *
                            (couplings[i].col(k_factor) - couplings[i].leftCols<k_shared_size>() * shared))
                               .head<3>());
  return out;
}

FlightRows divided(const FlightRows& flight, const Group& group, double by) {
  FlightRows out = flight;
  for (std::size_t i = 0; i < out.anchors.size(); ++i)
    for (JointRow& row : out.anchors[i].rows)
      if (group.has(i, antenna_of(flight, row))) row.distance_m /= by;
  return out;
}

/// With everything else, from ranges that the factor found so far is taken off.
Result<void> ask_again(const ScaleTest::Given& given, double first, Answer& answer) {
  JointState state = given.fit.state;
  ScaleFinding found = answer.found;
  found.value = first;
  for (int round = 0; round < k_rounds; ++round) {
    const double since = found.value;
    const FlightRows rows = divided(given.flight, answer.group, 1.0 + since);
    BOOST_OUTCOME_TRY(const auto again, solve_joint(rows, state, given.prior, given.options));
    found = ScaleTest({rows, again, given.prior, given.options}, Weighing::as_fitted)
                .ask(answer.group, since)
                .found;
    state = again.state;
    if (std::abs(found.value - since) < 0.05 * found.sigma) break;
  }
  if (std::isfinite(found.z) && std::abs(found.z) > std::abs(answer.found.z)) answer.found = found;
  return boost::outcome_v2::success();
}

/// What fails: beyond doubt, and large enough to matter.
double limit_of(const ScaleFinding& found) { return std::max(k_failing, k_failing_z * found.sigma); }
double over_limit(const Answer& answer) { return std::abs(answer.found.value) / limit_of(answer.found); }

/// How much of every factor the regions hold: the chance that it is there, or more where the ranges come
/// near to showing it.
void find_doubts(std::vector<Answer>& answers) {
  const double n = static_cast<double>(answers.size());
  double sum = 1.0 - k_chance_all - k_chance;
  for (Answer& answer : answers) {
    const double before = answer.group.all() ? k_chance_all : k_chance / n;
    // Likelihood with the factor over that without; no exponential overflows.
    const double chi2 = answer.found.z * answer.found.z;
    answer.doubt = before * answer.found.sigma / k_prior * std::exp(0.5 * std::min(chi2, 200.0));
    sum += answer.doubt;
  }
  for (Answer& answer : answers) {
    const double chi2 = answer.found.z * answer.found.z;
    const double near =
        std::clamp((chi2 - k_doubted_chi2 - 2 * std::log(n)) / (k_believed_chi2 - k_doubted_chi2), 0.0, 1.0);
    answer.doubt = std::max(answer.doubt / sum, near * near);
  }
}

std::string whose(const FlightRows& flight, const Group& group) {
  if (group.antenna) {
    const FlightAntenna& of = flight.antennas[*group.antenna];
    return "to antenna " + std::to_string(of.antenna) + " of tag " + to_string(of.tag);
  }
  return group.anchor ? "of this anchor" : "all ranges";
}

std::string why(const FlightRows& flight, const Answer& worst) {
  const ScaleFinding& found = worst.found;
  char text[400];
  if (over_limit(worst) <= 1)
    std::snprintf(text, sizeof text,
                  "no scale error of the ranges is seen: %s %+.2f %% with sigma %.2f %% (%.1f sigma)",
                  whose(flight, worst.group).c_str(), 100 * found.value, 100 * found.sigma,
                  std::abs(found.z));
  else
    std::snprintf(
        text, sizeof text,
        "the ranges are too %s by a factor (%s): %.4f with sigma %.4f (%.1f sigma); check the unit of "
        "the ranges, the clock and the delay settings of the radios, correct the ranges and solve "
        "again",
        found.value > 0 ? "long" : "short", whose(flight, worst.group).c_str(), 1 + found.value, found.sigma,
        std::abs(found.z));
  return text;
}

/// The group that speaks most against the anchor.
Gate gate_of(const FlightRows& flight, const std::vector<Answer>& answers, std::size_t anchor) {
  const Answer* worst = &answers.front();
  for (const Answer& answer : answers)
    if ((!answer.group.anchor || *answer.group.anchor == anchor) && over_limit(answer) > over_limit(*worst))
      worst = &answer;
  return {"range_scale", std::abs(worst->found.value), limit_of(worst->found), over_limit(*worst) <= 1,
          why(flight, *worst)};
}

/// Mean square of what an anchor is off by the factors there may be.
Eigen::Matrix4d off_m2(const std::vector<Answer>& answers, std::size_t anchor, Dims dims) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Zero();
  for (const Answer& answer : answers) {
    const double square = answer.found.value * answer.found.value + answer.found.sigma * answer.found.sigma;
    const Eigen::Vector3d& moved = answer.moved[anchor];
    out.topLeftCorner<3, 3>() += answer.doubt * square * moved * moved.transpose();
  }
  if (dims == Dims::two) {
    out.row(2).setZero();
    out.col(2).setZero();
  }
  return out;
}

}  // namespace

Result<RangeScale> check_range_scale(const FlightRows& flight, const JointFit& fit, const SharedPrior& prior,
                                     const FlightOptions& options) {
  const ScaleTest::Given given{flight, fit, prior, options};
  const ScaleTest fitted(given, Weighing::as_fitted), wide(given, Weighing::wide);
  std::vector<Answer> answers;
  struct Odd {
    double z{}, first{};
    std::size_t index{};
  };
  std::vector<Odd> odd;
  for (const Group& group : groups_of(flight, fit)) {
    const Answer& answer = answers.emplace_back(fitted.ask(group));
    const ScaleFinding wider = wide.ask(group).found;
    const ScaleFinding& odder = std::abs(wider.z) > std::abs(answer.found.z) ? wider : answer.found;
    odd.push_back({std::abs(odder.z), odder.value, answers.size() - 1});
  }
  std::ranges::stable_sort(odd, std::ranges::greater{}, &Odd::z);
  odd.resize(std::min(odd.size(), k_most_again));
  for (const Odd& one : odd) {
    if (one.z < k_odd_z) break;
    BOOST_OUTCOME_TRY(ask_again(given, one.first, answers[one.index]));
  }
  find_doubts(answers);
  RangeScale out;
  out.all = answers.front().found;
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    out.gates.push_back(gate_of(flight, answers, i));
    const Eigen::Matrix4d doubt_m2 = off_m2(answers, i, options.dims);
    const Eigen::Matrix4d& before_m2 = fit.anchor_covariance[i];
    n_wider +=
        fit.state.anchors[i].active && much_wider(before_m2 + doubt_m2, before_m2, options.dims) ? 1 : 0;
    out.covariance_m2.emplace_back(doubt_m2.topLeftCorner<3, 3>());
  }
  if (n_wider > 0) {
    char text[240];
    std::snprintf(text, sizeof text,
                  "%zu of %zu anchors are less accurate because of a possible scale error of the ranges: this "
                  "flight determines it with sigma %.1f %% only; ranges from near and far would improve it",
                  n_wider, flight.anchors.size(), 100 * out.all.sigma);
    out.note = text;
  }
  return out;
}

}  // namespace anchord
