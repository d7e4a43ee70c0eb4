#include "core/localize/systematic_error.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
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

/// Columns of Sums beside those of the lines, and the weights of each weighing; 0 in whole groups of four
/// beyond the rows. A column that is not asked is empty.
struct AskedColumns {
  std::vector<double> ones, near, residual;
  std::vector<std::vector<double>> weights;
  std::array<std::vector<double>, k_error_columns> asked{};
  AskedColumns(std::size_t padded, std::size_t n_weighings)
      : ones(padded, 1.0),
        near(padded),
        residual(padded),
        weights(n_weighings, std::vector<double>(padded)) {}
};

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
  /// With either weighing, from one look at the rows; only: the column that will be asked, all if absent.
  static std::vector<ErrorTest> of(const Given& given, std::span<const Weighing> weighings,
                                   const std::optional<std::size_t>& only = std::nullopt);
  ErrorAnswer ask(const ErrorQuestion& question) const;
  /// since  what the rows were corrected by already: the prior is about the whole
  ErrorFinding find(const ErrorQuestion& question, double since = 0) const;

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
  explicit ErrorTest(const Given& given) : given_(given) {}
  /// With the weights of each row, for each antenna; those of the lines in whole groups.
  Anchor anchor_of(std::size_t index, const JointLines& lines, const AskedColumns& columns,
                   std::span<const double> weights) const;
  void eliminate();
  /// What is asked, of the ranges of one antenna alone, or of all.
  Part part_of(std::size_t anchor, const std::optional<std::size_t>& antenna) const;
  /// What is asked, with what is known of it beside.
  struct Asked {
    Known with;
    ErrorFinding found{};
  };
  Asked asked_of(const ErrorQuestion& question, double since, std::span<const Part> of_antenna) const;
  /// Where one antenna is asked: part_of each anchor.
  std::vector<Part> parts_for(const ErrorQuestion& question) const;

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

AskedColumns asked_columns(const ErrorTest::Given& given, std::size_t index, const JointLines& lines,
                           std::span<const Weighing> weighings, const std::optional<std::size_t>& only) {
  const AnchorBlock& block = given.fit.normal.anchors[index];
  const Eigen::Vector3d& anchor_m = given.fit.state.anchors[index].position_m;
  AskedColumns out(lines.padded(), weighings.size());
  for (std::size_t k = 0; k < k_error_columns; ++k)
    if (!only || *only == k) out.asked[k].resize(lines.padded());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const JointRow& row = *lines.rows()[i];
    JointLine line;
    line.residual_m = lines.of(JointLines::residual)[i];
    line.position_variance_m2 = lines.of(JointLines::variance)[i];
    const WeighedRow by = weighed_row(row, line, block, block.scale_m, given.options);
    bool counts = false;
    for (std::size_t k = 0; k < weighings.size(); ++k) {
      const double weight = weight_per_m2(by, row, line, block, weighings[k]);
      if (!(weight > 0)) continue;
      out.weights[k][i] = weight;
      counts = true;
    }
    if (!counts) continue;
    const Eigen::Vector3d antenna_m(lines.of(JointLines::antenna_x)[i], lines.of(JointLines::antenna_y)[i],
                                    lines.of(JointLines::antenna_z)[i]);
    const Eigen::Vector3d to_anchor_m = anchor_m - antenna_m;
    const ErrorColumns columns = error_columns(given.middle, row.t_s, antenna_m.z(), to_anchor_m);
    for (std::size_t k = 0; k < k_error_columns; ++k)
      if (!out.asked[k].empty()) out.asked[k][i] = columns[k];
    out.near[i] = std::min(to_anchor_m.norm(), k_near_m) - k_near_right_m;
    out.residual[i] = by.residual_m;
  }
  return out;
}

/// The rows of one antenna, whose arm of its own, where it has one, is seen as the common one is. Columns
/// that are nothing are left out.
Sums sums_of_antenna(const JointLines& lines, const AskedColumns& columns, std::span<const double> weights,
                     const std::optional<std::int8_t>& arm) {
  using L = JointLines;
  std::vector<const double*> distinct;
  // Of each column of Sums, among those; -1: nothing.
  std::array<int, k_own + k_rest> from{};
  from.fill(-1);
  const auto put = [&](int column, const double* begin) {
    from[static_cast<std::size_t>(column)] = static_cast<int>(distinct.size());
    distinct.push_back(begin);
  };
  const auto same = [&](int column, int as) {
    from[static_cast<std::size_t>(column)] = from[static_cast<std::size_t>(as)];
  };
  constexpr int delay = k_own - 1;
  put(0, lines.begin(L::x));
  put(1, lines.begin(L::y));
  put(2, lines.begin(L::z));
  put(delay, columns.ones.data());
  same(k_own + k_shared_bias, delay);
  put(k_own + k_shared_curve, lines.begin(L::curve));
  put(k_own + k_shared_lag, lines.begin(L::lag));
  put(k_own + k_shared_lever, lines.begin(L::lever));
  if (arm) same(k_own + k_shared_antennas + *arm, k_own + k_shared_lever);
  if (!lines.level()) {
    put(k_own + k_shared_forward, lines.begin(L::forward));
    put(k_own + k_shared_left, lines.begin(L::left));
  }
  put(k_own + k_near, columns.near.data());
  for (std::size_t k = 0; k < k_error_columns; ++k)
    if (!columns.asked[k].empty()) put(k_own + k_asked + static_cast<int>(k), columns.asked[k].data());
  put(k_own + k_residual, columns.residual.data());
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

ErrorTest::Anchor ErrorTest::anchor_of(std::size_t index, const JointLines& lines,
                                       const AskedColumns& columns, std::span<const double> weights) const {
  const FlightRows& flight = given_.flight;
  const JointState::Anchor& anchor = given_.fit.state.anchors[index];
  Anchor out;
  out.by_antenna.assign(flight.antennas.size() + 1, Sums::Zero());
  if (lines.size() > 0 && lines.one_antenna()) {
    const JointRow& first = *lines.rows().front();
    out.by_antenna[antenna_of(flight, first)] = sums_of_antenna(lines, columns, weights, first.arm);
  } else {
    std::vector<std::size_t> antennas;
    antennas.reserve(lines.size());
    for (const JointRow* row : lines.rows()) antennas.push_back(antenna_of(flight, *row));
    std::vector<double> own(lines.padded());
    for (std::size_t antenna = 0; antenna < out.by_antenna.size(); ++antenna) {
      const JointRow* one = nullptr;
      for (std::size_t i = 0; i < antennas.size(); ++i) {
        own[i] = antennas[i] == antenna ? weights[i] : 0.0;
        if (antennas[i] == antenna) one = lines.rows()[i];
      }
      if (one != nullptr) out.by_antenna[antenna] = sums_of_antenna(lines, columns, own, one->arm);
    }
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

std::vector<ErrorTest> ErrorTest::of(const Given& given, std::span<const Weighing> weighings,
                                     const std::optional<std::size_t>& only) {
  std::vector<ErrorTest> tests(weighings.size(), ErrorTest(given));
  const FlightRows& flight = given.flight;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    const JointState::Anchor& anchor = given.fit.state.anchors[i];
    if (!anchor.active) {
      for (ErrorTest& test : tests)
        test.anchors_.emplace_back().by_antenna.assign(flight.antennas.size() + 1, Sums::Zero());
      continue;
    }
    const JointLines lines(flight.track, flight.anchors[i].rows, given.fit.state.shared, anchor);
    const AskedColumns columns = asked_columns(given, i, lines, weighings, only);
    for (std::size_t k = 0; k < tests.size(); ++k)
      tests[k].anchors_.push_back(tests[k].anchor_of(i, lines, columns, columns.weights[k]));
  }
  for (ErrorTest& test : tests) test.eliminate();
  return tests;
}

void ErrorTest::eliminate() {
  for (std::size_t i = 0; i < anchors_.size(); ++i)
    reduced_ += parts_.emplace_back(part_of(i, std::nullopt)).reduced;
  const SharedPrior prior = with_open_bias(given_.prior);
  gradient_ = reduced_.block<k_asked, 1>(0, k_residual);
  gradient_.head<k_shared_size>() += prior.information * (prior.mean - given_.fit.state.shared);
  KnownMatrix known = reduced_.topLeftCorner<k_asked, k_asked>();
  shared_.compute(known.topLeftCorner<k_shared_size, k_shared_size>() + given_.prior.information);
  known.topLeftCorner<k_shared_size, k_shared_size>() += prior.information;
  known(k_near, k_near) += 1.0 / (k_near_prior * k_near_prior);
  known_.compute(known);
}

std::vector<ErrorTest::Part> ErrorTest::parts_for(const ErrorQuestion& question) const {
  std::vector<Part> of_antenna;
  for (std::size_t i = 0; question.antenna && i < anchors_.size(); ++i)
    of_antenna.push_back(part_of(i, question.antenna));
  return of_antenna;
}

ErrorTest::Asked ErrorTest::asked_of(const ErrorQuestion& question, double since,
                                     std::span<const Part> of_antenna) const {
  const int column = k_asked + static_cast<int>(question.column);
  const auto asked = [&](int from, int to) {
    if (question.anchor) return parts_[*question.anchor].reduced(from, to);
    double sum = 0;
    for (const Part& part : of_antenna) sum += part.reduced(from, to);
    return question.antenna ? sum : reduced_(from, to);
  };
  Asked out;
  for (int i = 0; i < k_asked; ++i) out.with[i] = asked(i, column);
  const Known followed = known_.solve(out.with);
  const double information = std::max(asked(column, column) - out.with.dot(followed), 0.0);
  const double score = asked(column, k_residual) - followed.dot(gradient_) + information * since;
  const double with_prior = information + 1.0 / (question.known().prior * question.known().prior);
  out.found = {score / with_prior, 1.0 / std::sqrt(with_prior), score / std::sqrt(with_prior)};
  return out;
}

ErrorFinding ErrorTest::find(const ErrorQuestion& question, double since) const {
  return asked_of(question, since, parts_for(question)).found;
}

ErrorAnswer ErrorTest::ask(const ErrorQuestion& question) const {
  const int column = k_asked + static_cast<int>(question.column);
  const std::vector<Part> of_antenna = parts_for(question);
  const Asked asked = asked_of(question, 0, of_antenna);
  ErrorAnswer out;
  out.question = question;
  out.found = asked.found;
  // The fit followed the error with the prior it has, and without a slope.
  const SharedVector shared = shared_.solve(asked.with.head<k_shared_size>());
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
    constexpr std::array k_as_fitted{Weighing::as_fitted};
    found = ErrorTest::of({rows, again, given.prior, given.options, given.middle}, k_as_fitted,
                          answer.question.column)
                .front()
                .find(answer.question, since);
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
  constexpr std::array k_both{Weighing::as_fitted, Weighing::wide};
  const std::vector<ErrorTest> tests = ErrorTest::of(given, k_both);
  const ErrorTest &fitted = tests.front(), &wide = tests.back();
  std::vector<ErrorAnswer> answers;
  struct Odd {
    double z{}, first{};
    std::size_t index{};
  };
  std::vector<Odd> odd;
  for (const ErrorQuestion& question : error_questions(given.flight, given.fit)) {
    // There are as many as anchors and antennas, and each looks at all of them.
    if (given.options.canceled && given.options.canceled()) return make_error(Errc::canceled, "canceled");
    const ErrorAnswer& answer = answers.emplace_back(fitted.ask(question));
    const ErrorFinding wider = wide.find(question);
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
