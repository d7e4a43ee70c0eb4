#include "core/localize/systematic_error.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/localize/joint_lines.hpp"
#include "core/localize/weighed_row.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr double k_near_m = 5.0;        // below, ranges of real radios have a slope of their own,
constexpr double k_near_right_m = 2.5;  // right at about this distance,
constexpr double k_near_prior = 0.06;   // by so many metres a metre, one sigma
constexpr double k_odd_z = 1.5;         // worth another solve
constexpr std::size_t k_most_again = 3;
constexpr int k_rounds = 3;
constexpr double k_shown_z = 4, k_growing = 1.1;
constexpr double k_wide_scales = 3;         // beyond, a residual counts less: a factor makes them large
constexpr double k_imitated_bias_m = 0.15;  // no factor is shown by ranges that only differ from a known bias
// As of a shift of the track.
constexpr double k_doubted_chi2 = 3, k_believed_chi2 = 9;

// One range in the normal equations: by_anchor, by_shared, slope of near ranges, what is asked, residual.
constexpr int k_errors = static_cast<int>(k_error_columns);
constexpr int k_own = 4, k_near = k_shared_size, k_asked = k_near + 1, k_residual = k_asked + k_errors,
              k_rest = k_residual + 1;
using Sums = Eigen::Matrix<double, k_own + k_rest, k_own + k_rest>;
using Rest = Eigen::Matrix<double, k_rest, k_rest>;
using Coupling = Eigen::Matrix<double, k_own, k_rest>;
using Known = Eigen::Matrix<double, k_asked, 1>;
using KnownMatrix = Eigen::Matrix<double, k_asked, k_asked>;

/// How residuals count: as in the fit, or large ones less, but all of them: what an error makes of ranges the
/// fit may have taken for outliers.
enum class Weighing : std::uint8_t { as_fitted, wide };

/// The normal equations of a fit, to ask them for errors.
class ErrorTest {
 public:
  struct Given {
    const FlightRows& flight;
    const JointFit& fit;
    const SharedPrior& prior;
    const FlightOptions& options;
    const FlightMiddle& middle;
  };
  ErrorTest(const Given& given, Weighing weighing);
  /// since  what the rows were corrected by already: the prior is about the whole
  ErrorAnswer ask(const ErrorQuestion& question, double since = 0) const;

 private:
  struct Anchor {
    std::vector<Sums> by_antenna{};
    Eigen::Matrix4d own_inverse{Eigen::Matrix4d::Zero()};
    Eigen::Vector4d prior_gradient{Eigen::Vector4d::Zero()};
  };
  /// Of one anchor: place and delay beside the rest, and the rest without them.
  struct Part {
    Coupling coupling;
    Rest reduced;
  };
  Anchor anchor_of(std::size_t index, Weighing weighing) const;
  /// What is asked, of the ranges of one antenna alone, or of all.
  Part part_of(std::size_t anchor, const std::optional<std::size_t>& antenna) const;

  Given given_;
  std::vector<Anchor> anchors_;
  std::vector<Part> parts_;           ///< of all antennas
  Rest reduced_{Rest::Zero()};        ///< of all anchors
  Known gradient_{Known::Zero()};     ///< of what is known beside: by_shared, slope of near ranges
  Eigen::LDLT<KnownMatrix> known_;    ///< with a bias that is open
  Eigen::LDLT<SharedMatrix> shared_;  ///< as in the fit, which has no slope
};

double weight_per_m2(const WeighedRow& by, const JointRow& row, const JointLine& line,
                     const AnchorBlock& block, Weighing weighing) {
  if (weighing == Weighing::as_fitted || row.error_model) return by.per_m2;
  const double variance_m2 = row_variance_m2(line, block, block.scale_m);
  const double over2 = line.residual_m * line.residual_m / (k_wide_scales * k_wide_scales * variance_m2);
  return (over2 <= 1 ? 1.0 : 1.0 / over2) / (variance_m2 * block.kappa);
}

/// Columns of Sums beside those of the lines, and weights: 0 in whole groups of four beyond the rows.
struct AskedColumns {
  std::vector<double> ones, near, residual, weight;
  std::array<std::vector<double>, k_error_columns> asked;
  explicit AskedColumns(std::size_t padded)
      : ones(padded, 1.0), near(padded), residual(padded), weight(padded) {
    asked.fill(std::vector<double>(padded));
  }
};

AskedColumns asked_columns(const ErrorTest::Given& given, std::size_t index, const JointLines& lines,
                           Weighing weighing) {
  const AnchorBlock& block = given.fit.normal.anchors[index];
  const Eigen::Vector3d& anchor_m = given.fit.state.anchors[index].position_m;
  AskedColumns out(lines.padded());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const JointRow& row = *lines.rows()[i];
    JointLine line;
    line.residual_m = lines.of(JointLines::residual)[i];
    line.position_variance_m2 = lines.of(JointLines::variance)[i];
    const WeighedRow by = weighed_row(row, line, block, block.scale_m, given.options);
    const double weight = weight_per_m2(by, row, line, block, weighing);
    if (!(weight > 0)) continue;
    const Eigen::Vector3d antenna_m(lines.of(JointLines::antenna_x)[i], lines.of(JointLines::antenna_y)[i],
                                    lines.of(JointLines::antenna_z)[i]);
    const Eigen::Vector3d to_anchor_m = anchor_m - antenna_m;
    const ErrorColumns columns = error_columns(given.middle, row.t_s, antenna_m.z(), to_anchor_m);
    for (std::size_t k = 0; k < k_error_columns; ++k) out.asked[k][i] = columns[k];
    out.near[i] = std::min(to_anchor_m.norm(), k_near_m) - k_near_right_m;
    out.residual[i] = by.residual_m;
    out.weight[i] = weight;
  }
  return out;
}

/// The rows of one antenna, whose arm of its own, where it has one, is seen as the common one is.
Sums sums_of_antenna(const JointLines& lines, const AskedColumns& columns, std::span<const double> weights,
                     const std::optional<std::int8_t>& arm) {
  using L = JointLines;
  constexpr std::size_t k_of_lines = 9, k_distinct = k_of_lines + 1 + k_error_columns + 1;
  std::array<const double*, k_distinct> distinct{
      lines.begin(L::x),     lines.begin(L::y),   lines.begin(L::z),     columns.ones.data(),
      lines.begin(L::curve), lines.begin(L::lag), lines.begin(L::lever), lines.begin(L::forward),
      lines.begin(L::left),  columns.near.data()};
  for (std::size_t k = 0; k < k_error_columns; ++k) distinct[k_of_lines + 1 + k] = columns.asked[k].data();
  distinct.back() = columns.residual.data();
  constexpr int ones = 3, lever = 6;
  // Of each column of Sums, among those; -1: nothing.
  std::array<int, k_own + k_rest> from{0, 1, 2, ones, ones, 4, 5, lever, 7, 8};
  static_assert(k_own + k_shared_antennas == 10 && k_shared_curve == 1 && k_shared_lag == 2 &&
                k_shared_lever == 3 && k_shared_forward == 4 && k_shared_left == 5);
  for (int i = k_own + k_shared_antennas; i < k_own + k_shared_size; ++i)
    from[static_cast<std::size_t>(i)] = -1;
  if (arm) from[static_cast<std::size_t>(k_own + k_shared_antennas + *arm)] = lever;
  for (std::size_t i = 0; k_of_lines + i < k_distinct; ++i)
    from[k_own + k_near + i] = static_cast<int>(k_of_lines + i);
  const std::vector<double> products = weighted_products(distinct, weights);
  Sums out = Sums::Zero();
  for (int i = 0; i < k_own + k_rest; ++i)
    for (int j = 0; j < k_own + k_rest; ++j) {
      const int a = from[static_cast<std::size_t>(i)], b = from[static_cast<std::size_t>(j)];
      if (a >= 0 && b >= 0)
        out(i, j) = products[static_cast<std::size_t>(a) * distinct.size() + static_cast<std::size_t>(b)];
    }
  return out;
}

ErrorTest::Anchor ErrorTest::anchor_of(std::size_t index, Weighing weighing) const {
  const FlightRows& flight = given_.flight;
  const JointState::Anchor& anchor = given_.fit.state.anchors[index];
  Anchor out;
  out.by_antenna.assign(flight.antennas.size() + 1, Sums::Zero());
  if (!anchor.active) return out;
  const JointLines lines(flight.track, flight.anchors[index].rows, given_.fit.state.shared, anchor);
  const AskedColumns columns = asked_columns(given_, index, lines, weighing);
  std::vector<std::size_t> antennas;
  antennas.reserve(lines.size());
  for (const JointRow* row : lines.rows()) antennas.push_back(antenna_of(flight, *row));
  std::vector<double> weights(lines.padded());
  for (std::size_t antenna = 0; antenna < out.by_antenna.size(); ++antenna) {
    const JointRow* one = nullptr;
    for (std::size_t i = 0; i < antennas.size(); ++i) {
      weights[i] = antennas[i] == antenna ? columns.weight[i] : 0.0;
      if (antennas[i] == antenna) one = lines.rows()[i];
    }
    if (one != nullptr) out.by_antenna[antenna] = sums_of_antenna(lines, columns, weights, one->arm);
  }
  Eigen::Matrix4d own = Eigen::Matrix4d::Zero();
  for (const Sums& sums : out.by_antenna) own += sums.topLeftCorner<k_own, k_own>();
  out.own_inverse =
      add_anchor_priors(flight.anchors[index].id, anchor, given_.options, own, out.prior_gradient);
  return out;
}

ErrorTest::Part ErrorTest::part_of(std::size_t anchor, const std::optional<std::size_t>& antenna) const {
  const Anchor& of = anchors_[anchor];
  Sums all = Sums::Zero();
  for (std::size_t k = 0; k < of.by_antenna.size(); ++k) {
    Sums sums = of.by_antenna[k];
    if (antenna && k != *antenna) {
      sums.middleRows<k_errors>(k_own + k_asked).setZero();
      sums.middleCols<k_errors>(k_own + k_asked).setZero();
    }
    all += sums;
  }
  Part out{all.topRightCorner<k_own, k_rest>(), all.bottomRightCorner<k_rest, k_rest>()};
  out.coupling.col(k_residual) += of.prior_gradient;
  if (given_.options.dims == Dims::two) out.coupling.row(2).setZero();
  out.reduced -= out.coupling.transpose() * of.own_inverse * out.coupling;
  return out;
}

/// A prior that takes the kit for calibrated would make an error of what a bias is.
SharedPrior with_open_bias(SharedPrior prior) {
  SharedMatrix covariance = prior.information.inverse();
  covariance(k_shared_bias, k_shared_bias) += k_imitated_bias_m * k_imitated_bias_m;
  prior.information = covariance.inverse();
  return prior;
}

ErrorTest::ErrorTest(const Given& given, Weighing weighing) : given_(given) {
  for (std::size_t i = 0; i < given.flight.anchors.size(); ++i) {
    anchors_.push_back(anchor_of(i, weighing));
    reduced_ += parts_.emplace_back(part_of(i, std::nullopt)).reduced;
  }
  const SharedPrior prior = with_open_bias(given.prior);
  gradient_ = reduced_.block<k_asked, 1>(0, k_residual);
  gradient_.head<k_shared_size>() += prior.information * (prior.mean - given.fit.state.shared);
  KnownMatrix known = reduced_.topLeftCorner<k_asked, k_asked>();
  shared_.compute(known.topLeftCorner<k_shared_size, k_shared_size>() + given.prior.information);
  known.topLeftCorner<k_shared_size, k_shared_size>() += prior.information;
  known(k_near, k_near) += 1.0 / (k_near_prior * k_near_prior);
  known_.compute(known);
}

ErrorAnswer ErrorTest::ask(const ErrorQuestion& question, double since) const {
  const int column = k_asked + static_cast<int>(question.column);
  std::vector<Part> of_antenna;
  Rest asked = question.anchor ? parts_[*question.anchor].reduced : reduced_;
  if (question.antenna) {
    asked.setZero();
    for (std::size_t i = 0; i < anchors_.size(); ++i)
      asked += of_antenna.emplace_back(part_of(i, question.antenna)).reduced;
  }
  const Known with = asked.block<k_asked, 1>(0, column), followed = known_.solve(with);
  const double information = std::max(asked(column, column) - with.dot(followed), 0.0);
  const double score = asked(column, k_residual) - followed.dot(gradient_) + information * since;
  const double with_prior = information + 1.0 / (question.known().prior * question.known().prior);
  ErrorAnswer out;
  out.question = question;
  out.found = {score / with_prior, 1.0 / std::sqrt(with_prior), score / std::sqrt(with_prior)};
  // The fit followed the error with the prior it has, and without a slope.
  const SharedVector shared = shared_.solve(with.head<k_shared_size>());
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    Eigen::Vector4d own = -(parts_[i].coupling.leftCols<k_shared_size>() * shared);
    if (!question.anchor || *question.anchor == i)
      own += (question.antenna ? of_antenna : parts_)[i].coupling.col(column);
    out.moved.emplace_back((anchors_[i].own_inverse * own).head<3>());
  }
  return out;
}

FlightRows corrected(const ErrorTest::Given& given, const ErrorQuestion& question, double value) {
  FlightRows out = given.flight;
  for (std::size_t i = 0; i < out.anchors.size(); ++i) {
    for (JointRow& row : out.anchors[i].rows) {
      if (!question.has(i, antenna_of(given.flight, row))) continue;
      if (question.kind() == ErrorKind::factor) {
        row.distance_m /= 1.0 + value;
        continue;
      }
      const JointState::Anchor& anchor = given.fit.state.anchors[i];
      const JointLine line = linearise(given.flight.track, row, given.fit.state.shared, anchor);
      row.distance_m -= value * error_columns(given.middle, row.t_s, line.antenna_m.z(),
                                              anchor.position_m - line.antenna_m)[question.column];
    }
  }
  return out;
}

/// With everything else, from ranges that the error found so far is taken off.
Result<void> ask_again(const ErrorTest::Given& given, double first, ErrorAnswer& answer) {
  JointState state = given.fit.state;
  ErrorFinding found = answer.found;
  found.value = first;
  for (int round = 0; round < k_rounds; ++round) {
    const double since = found.value, before_z = std::abs(found.z);
    const FlightRows rows = corrected(given, answer.question, since);
    BOOST_OUTCOME_TRY(const auto again, solve_joint(rows, state, given.prior, given.options));
    found = ErrorTest({rows, again, given.prior, given.options, given.middle}, Weighing::as_fitted)
                .ask(answer.question, since)
                .found;
    state = again.state;
    if (std::abs(found.value - since) < 0.05 * found.sigma) break;
    // An error that is there shows the more, the more of it was taken off.
    if (std::abs(found.z) < k_shown_z && std::abs(found.z) < k_growing * before_z) break;
  }
  if (std::isfinite(found.z) && std::abs(found.z) > std::abs(answer.found.z)) answer.found = found;
  return boost::outcome_v2::success();
}

/// The first are of all ranges, in the order of their columns.
Result<std::vector<ErrorAnswer>> answers_of(const ErrorTest::Given& given) {
  const ErrorTest fitted(given, Weighing::as_fitted), wide(given, Weighing::wide);
  std::vector<ErrorAnswer> answers;
  struct Odd {
    double z{}, first{};
    std::size_t index{};
  };
  std::vector<Odd> odd;
  for (const ErrorQuestion& question : error_questions(given.flight, given.fit)) {
    const ErrorAnswer& answer = answers.emplace_back(fitted.ask(question));
    const ErrorFinding wider = wide.ask(question).found;
    const ErrorFinding& odder = std::abs(wider.z) > std::abs(answer.found.z) ? wider : answer.found;
    odd.push_back({std::abs(odder.z), odder.value, answers.size() - 1});
  }
  std::ranges::stable_sort(odd, std::ranges::greater{}, &Odd::z);
  odd.resize(std::min(odd.size(), k_most_again));
  for (const Odd& one : odd) {
    if (one.z < k_odd_z) break;
    BOOST_OUTCOME_TRY(ask_again(given, one.first, answers[one.index]));
  }
  return answers;
}

/// How much of every error the regions hold: the chance that it is there, or more where the ranges come near
/// to showing it.
void find_doubts(std::vector<ErrorAnswer>& answers) {
  const double n = static_cast<double>(answers.size());
  const double n_some = static_cast<double>(
      std::ranges::count_if(answers, [](const ErrorAnswer& one) { return !one.question.all(); }));
  double sum = chance_of_no_error();
  for (ErrorAnswer& answer : answers) {
    const KnownError& known = answer.question.known();
    const double before = answer.question.all() ? known.chance : known.chance / n_some;
    // Likelihood with the error over that without; no exponential overflows.
    const double chi2 = answer.found.z * answer.found.z;
    answer.doubt = before * answer.found.sigma / known.prior * std::exp(0.5 * std::min(chi2, 200.0));
    sum += answer.doubt;
  }
  for (ErrorAnswer& answer : answers) {
    const double chi2 = answer.found.z * answer.found.z;
    const double near =
        std::clamp((chi2 - k_doubted_chi2 - 2 * std::log(n)) / (k_believed_chi2 - k_doubted_chi2), 0.0, 1.0);
    answer.doubt = std::max(answer.doubt / sum, near * near);
  }
}

/// Mean square of what an anchor is off by the errors there may be.
Eigen::Matrix4d off_m2(const std::vector<ErrorAnswer>& answers, std::size_t anchor, Dims dims) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Zero();
  for (const ErrorAnswer& answer : answers) {
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

Result<SystematicErrors> check_systematic_errors(const FlightRows& flight, const JointFit& fit,
                                                 const SharedPrior& prior, const FlightOptions& options) {
  const FlightMiddle middle = middle_of(flight, fit.state);
  const ErrorTest::Given given{flight, fit, prior, options, middle};
  BOOST_OUTCOME_TRY(auto answers, answers_of(given));
  find_doubts(answers);
  SystematicErrors out;
  const auto found = [&](ErrorKind kind) { return answers[static_cast<std::size_t>(kind)].found; };
  out.scale = found(ErrorKind::factor);
  out.step = found(ErrorKind::step);
  out.drift = found(ErrorKind::drift);
  out.track_heights = found(ErrorKind::track_heights);
  for (std::size_t k = k_track_columns; k < k_error_columns; ++k)
    if (answers[k].found.sigma > out.track_drift.sigma) out.track_drift = answers[k].found;
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    out.gates.push_back(error_gates(flight, middle, answers, i));
    const Eigen::Matrix4d doubt_m2 = off_m2(answers, i, options.dims);
    const Eigen::Matrix4d& before_m2 = fit.anchor_covariance[i];
    n_wider +=
        fit.state.anchors[i].active && much_wider(before_m2 + doubt_m2, before_m2, options.dims) ? 1 : 0;
    out.covariance_m2.emplace_back(doubt_m2.topLeftCorner<3, 3>());
  }
  if (n_wider > 0) {
    char text[400];
    std::snprintf(
        text, sizeof text,
        "%zu of %zu anchors are less accurate because of possible systematic errors, which this flight "
        "determines only so well: of the ranges scale %.1f %%, step between low and high %.2f m, drift over "
        "the flight %.2f m; of the track drift %.2f m, heights %.1f %% (one sigma)",
        n_wider, flight.anchors.size(), 100 * out.scale.sigma, out.step.sigma, out.drift.sigma,
        out.track_drift.sigma, 100 * out.track_heights.sigma);
    out.note = text;
  }
  return out;
}

}  // namespace anchord
