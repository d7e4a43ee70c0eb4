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
constexpr double k_failing_z = 4.0;
constexpr double k_odd_z = 1.5;  // worth another solve
constexpr std::size_t k_most_again = 3;
constexpr int k_rounds = 3;
constexpr double k_wide_scales = 3;         // beyond, a residual counts less: a factor makes them large
constexpr double k_imitated_bias_m = 0.15;  // no factor is shown by ranges that only differ from a known bias
// As of a shift of the track.
constexpr double k_doubted_chi2 = 3, k_believed_chi2 = 9;

/// What is known of a kind of error before the ranges are asked.
struct Kind {
  double prior;    ///< one sigma
  double failing;  ///< less moves no anchor out of its region
  double chance;   ///< of a flight to have one
};
// 2 to 10 % are what wrong clocks and units do.
constexpr Kind k_factor_of_all{0.05, 0.005, 0.07}, k_factor_of_some{0.05, 0.005, 0.05};
constexpr Kind k_height_step{0.3, 0.10, 0.02}, k_drift{0.3, 0.10, 0.02};

// One range in the normal equations: by_anchor, by_shared, slope of near ranges, what is asked, residual.
constexpr int k_own = 4, k_near = k_shared_size, k_asked = k_near + 1, k_residual = k_asked + 3,
              k_rest = k_residual + 1;
using Sums = Eigen::Matrix<double, k_own + k_rest, k_own + k_rest>;
using Rest = Eigen::Matrix<double, k_rest, k_rest>;
using Coupling = Eigen::Matrix<double, k_own, k_rest>;

/// Errors that are asked for, in the order of their columns.
enum class ErrorKind : std::uint8_t { factor, step, drift };

/// An error and the ranges that may have it: all, or those of one antenna, or of one anchor.
struct Question {
  ErrorKind kind{ErrorKind::factor};
  std::optional<std::size_t> antenna{}, anchor{};
  bool all() const { return !anchor && !antenna; }
  bool has(std::size_t of_anchor, std::size_t of_antenna) const {
    return (!anchor || *anchor == of_anchor) && (!antenna || *antenna == of_antenna);
  }
  const Kind& known() const {
    switch (kind) {
      case ErrorKind::step:
        return k_height_step;
      case ErrorKind::drift:
        return k_drift;
      case ErrorKind::factor:
        break;
    }
    return all() ? k_factor_of_all : k_factor_of_some;
  }
};

std::size_t antenna_of(const FlightRows& flight, const JointRow& row) {
  const auto at = std::ranges::find_if(flight.antennas, [&](const FlightAntenna& one) {
    return one.tag == row.tag && one.antenna == row.antenna;
  });
  return static_cast<std::size_t>(at - flight.antennas.begin());
}

/// Where the flight's halves meet.
struct Middle {
  double up_m{};  ///< of the antennas, median over the ranges
  double from_s{}, length_s{};
};

Middle middle_of(const FlightRows& flight, const JointState& state) {
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

/// What one unit of each error adds to a range: metres a unit.
struct Columns {
  double by[3]{};
  double of(ErrorKind kind) const { return by[static_cast<int>(kind)]; }
};

Columns columns_of(const Middle& middle, const JointRow& row, double antenna_up_m, double distance_m) {
  return {{distance_m, antenna_up_m > middle.up_m ? 1.0 : 0.0, (row.t_s - middle.from_s) / middle.length_s}};
}

std::vector<Question> questions_of(const FlightRows& flight, const JointFit& fit) {
  std::vector<Question> questions{{ErrorKind::factor}, {ErrorKind::step}, {ErrorKind::drift}};
  for (std::size_t k = 0; flight.antennas.size() > 1 && k < flight.antennas.size(); ++k)
    questions.push_back({.antenna = k});
  for (std::size_t i = 0; i < flight.anchors.size(); ++i)
    if (fit.state.anchors[i].active) questions.push_back({.anchor = i});
  return questions;
}

/// How residuals count: as in the fit, or large ones less, but all of them: what an error makes of ranges the
/// fit may have taken for outliers.
enum class Weighing : std::uint8_t { as_fitted, wide };

/// What the flight says about one question.
struct Answer {
  Question question;
  ErrorFinding found;
  std::vector<Eigen::Vector3d>
      moved{};     ///< how the anchors of the fit, which has no such error, follow it; metres a unit
  double doubt{};  ///< 0..1: how much of it the regions hold
};

/// The normal equations of a fit, to ask them for errors.
class ErrorTest {
 public:
  struct Given {
    const FlightRows& flight;
    const JointFit& fit;
    const SharedPrior& prior;
    const FlightOptions& options;
    const Middle& middle;
  };
  ErrorTest(const Given& given, Weighing weighing);
  /// since  what the rows were corrected by already: the prior is about the whole
  Answer ask(const Question& question, double since = 0) const;

 private:
  struct Anchor {
    std::vector<Sums> by_antenna{};
    Eigen::Matrix4d own_inverse{Eigen::Matrix4d::Zero()};
    Eigen::Vector4d prior_gradient{Eigen::Vector4d::Zero()};
  };
  Anchor anchor_of(std::size_t index, Weighing weighing) const;
  Sums sums_of(std::size_t anchor, const Question& question) const;

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

/// Columns of Sums beside those of the lines, and weights: 0 in whole groups of four beyond the rows.
struct AskedColumns {
  std::vector<double> ones, near, factor, step, drift, residual, weight;
  explicit AskedColumns(std::size_t padded)
      : ones(padded, 1.0),
        near(padded),
        factor(padded),
        step(padded),
        drift(padded),
        residual(padded),
        weight(padded) {}
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
    const double distance_m = (antenna_m - anchor_m).norm();
    const Columns asked = columns_of(given.middle, row, antenna_m.z(), distance_m);
    out.near[i] = std::min(distance_m, k_near_m) - k_near_right_m;
    out.factor[i] = asked.of(ErrorKind::factor);
    out.step[i] = asked.of(ErrorKind::step);
    out.drift[i] = asked.of(ErrorKind::drift);
    out.residual[i] = by.residual_m;
    out.weight[i] = weight;
  }
  return out;
}

/// The rows of one antenna, whose arm of its own, where it has one, is seen as the common one is.
Sums sums_of_antenna(const JointLines& lines, const AskedColumns& columns, std::span<const double> weights,
                     const std::optional<std::int8_t>& arm) {
  using L = JointLines;
  const std::array<const double*, 14> distinct{
      lines.begin(L::x),     lines.begin(L::y),      lines.begin(L::z),     columns.ones.data(),
      lines.begin(L::curve), lines.begin(L::lag),    lines.begin(L::lever), lines.begin(L::forward),
      lines.begin(L::left),  columns.near.data(),    columns.factor.data(), columns.step.data(),
      columns.drift.data(),  columns.residual.data()};
  constexpr int ones = 3, lever = 6;
  // Of each column of Sums, among those; -1: nothing.
  std::array<int, k_own + k_rest> from{0, 1, 2, ones, ones, 4, 5, lever, 7, 8};
  static_assert(k_own + k_shared_antennas == 10 && k_shared_curve == 1 && k_shared_lag == 2 &&
                k_shared_lever == 3 && k_shared_forward == 4 && k_shared_left == 5);
  for (int i = k_own + k_shared_antennas; i < k_own + k_shared_size; ++i)
    from[static_cast<std::size_t>(i)] = -1;
  if (arm) from[static_cast<std::size_t>(k_own + k_shared_antennas + *arm)] = lever;
  for (int i = 0; i < 5; ++i) from[static_cast<std::size_t>(k_own + k_near + i)] = 9 + i;
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

ErrorTest::ErrorTest(const Given& given, Weighing weighing) : given_(given) {
  for (std::size_t i = 0; i < given.flight.anchors.size(); ++i) anchors_.push_back(anchor_of(i, weighing));
}

/// Of one anchor, with the column of the question where the first of those asked is; where the question has
/// no part, nothing stands there.
Sums ErrorTest::sums_of(std::size_t anchor, const Question& question) const {
  const int column = k_own + k_asked, asked = column + static_cast<int>(question.kind);
  Sums all = Sums::Zero();
  for (std::size_t k = 0; k < anchors_[anchor].by_antenna.size(); ++k) {
    Sums sums = anchors_[anchor].by_antenna[k];
    sums.row(column).swap(sums.row(asked));
    sums.col(column).swap(sums.col(asked));
    if (!question.has(anchor, k)) {
      sums.row(column).setZero();
      sums.col(column).setZero();
    }
    all += sums;
  }
  return all;
}

/// A prior that takes the kit for calibrated would make an error of what a bias is.
SharedPrior with_open_bias(SharedPrior prior) {
  SharedMatrix covariance = prior.information.inverse();
  covariance(k_shared_bias, k_shared_bias) += k_imitated_bias_m * k_imitated_bias_m;
  prior.information = covariance.inverse();
  return prior;
}

Answer ErrorTest::ask(const Question& question, double since) const {
  const SharedPrior prior = with_open_bias(given_.prior);
  Rest rest = Rest::Zero();
  std::vector<Coupling> couplings;
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const Sums sums = sums_of(i, question);
    Coupling& coupling = couplings.emplace_back(sums.topRightCorner<k_own, k_rest>());
    coupling.col(k_residual) += anchors_[i].prior_gradient;
    if (given_.options.dims == Dims::two) coupling.row(2).setZero();
    rest +=
        sums.bottomRightCorner<k_rest, k_rest>() - coupling.transpose() * anchors_[i].own_inverse * coupling;
  }
  rest.topLeftCorner<k_shared_size, k_shared_size>() += prior.information;
  rest.block<k_shared_size, 1>(0, k_residual) += prior.information * (prior.mean - given_.fit.state.shared);
  rest(k_near, k_near) += 1.0 / (k_near_prior * k_near_prior);
  const Eigen::Matrix<double, k_asked, 1> with = rest.block<k_asked, 1>(0, k_asked);
  const Eigen::Matrix<double, k_asked, 1> followed =
      rest.topLeftCorner<k_asked, k_asked>().ldlt().solve(with);
  const double information = std::max(rest(k_asked, k_asked) - with.dot(followed), 0.0);
  const double score =
      rest(k_asked, k_residual) - followed.dot(rest.block<k_asked, 1>(0, k_residual)) + information * since;
  const double with_prior = information + 1.0 / (question.known().prior * question.known().prior);
  Answer out;
  out.question = question;
  out.found = {score / with_prior, 1.0 / std::sqrt(with_prior), score / std::sqrt(with_prior)};
  // The fit followed the error with the prior it has, and without a slope.
  rest.topLeftCorner<k_shared_size, k_shared_size>() += given_.prior.information - prior.information;
  const SharedVector shared =
      rest.topLeftCorner<k_shared_size, k_shared_size>().ldlt().solve(with.head<k_shared_size>());
  for (std::size_t i = 0; i < anchors_.size(); ++i)
    out.moved.emplace_back((anchors_[i].own_inverse *
                            (couplings[i].col(k_asked) - couplings[i].leftCols<k_shared_size>() * shared))
                               .head<3>());
  return out;
}

FlightRows corrected(const ErrorTest::Given& given, const Question& question, double value) {
  FlightRows out = given.flight;
  for (std::size_t i = 0; i < out.anchors.size(); ++i) {
    for (JointRow& row : out.anchors[i].rows) {
      if (!question.has(i, antenna_of(given.flight, row))) continue;
      if (question.kind == ErrorKind::factor) {
        row.distance_m /= 1.0 + value;
        continue;
      }
      const JointLine line =
          linearise(given.flight.track, row, given.fit.state.shared, given.fit.state.anchors[i]);
      row.distance_m -= value * columns_of(given.middle, row, line.antenna_m.z(), 0).of(question.kind);
    }
  }
  return out;
}

/// With everything else, from ranges that the error found so far is taken off.
Result<void> ask_again(const ErrorTest::Given& given, double first, Answer& answer) {
  JointState state = given.fit.state;
  ErrorFinding found = answer.found;
  found.value = first;
  for (int round = 0; round < k_rounds; ++round) {
    const double since = found.value;
    const FlightRows rows = corrected(given, answer.question, since);
    BOOST_OUTCOME_TRY(const auto again, solve_joint(rows, state, given.prior, given.options));
    found = ErrorTest({rows, again, given.prior, given.options, given.middle}, Weighing::as_fitted)
                .ask(answer.question, since)
                .found;
    state = again.state;
    if (std::abs(found.value - since) < 0.05 * found.sigma) break;
  }
  if (std::isfinite(found.z) && std::abs(found.z) > std::abs(answer.found.z)) answer.found = found;
  return boost::outcome_v2::success();
}

/// The first three are of all ranges, in the order of ErrorKind.
Result<std::vector<Answer>> answers_of(const ErrorTest::Given& given) {
  const ErrorTest fitted(given, Weighing::as_fitted), wide(given, Weighing::wide);
  std::vector<Answer> answers;
  struct Odd {
    double z{}, first{};
    std::size_t index{};
  };
  std::vector<Odd> odd;
  for (const Question& question : questions_of(given.flight, given.fit)) {
    const Answer& answer = answers.emplace_back(fitted.ask(question));
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

/// What fails: beyond doubt, and large enough to matter.
double limit_of(const Answer& answer) {
  return std::max(answer.question.known().failing, k_failing_z * answer.found.sigma);
}
double over_limit(const Answer& answer) { return std::abs(answer.found.value) / limit_of(answer); }

/// How much of every error the regions hold: the chance that it is there, or more where the ranges come near
/// to showing it.
void find_doubts(std::vector<Answer>& answers) {
  const double n = static_cast<double>(answers.size());
  const double n_some = static_cast<double>(
      std::ranges::count_if(answers, [](const Answer& one) { return !one.question.all(); }));
  double sum = 1.0 - k_factor_of_all.chance - k_factor_of_some.chance - k_height_step.chance - k_drift.chance;
  for (Answer& answer : answers) {
    const Kind& known = answer.question.known();
    const double before = answer.question.all() ? known.chance : known.chance / n_some;
    // Likelihood with the error over that without; no exponential overflows.
    const double chi2 = answer.found.z * answer.found.z;
    answer.doubt = before * answer.found.sigma / known.prior * std::exp(0.5 * std::min(chi2, 200.0));
    sum += answer.doubt;
  }
  for (Answer& answer : answers) {
    const double chi2 = answer.found.z * answer.found.z;
    const double near =
        std::clamp((chi2 - k_doubted_chi2 - 2 * std::log(n)) / (k_believed_chi2 - k_doubted_chi2), 0.0, 1.0);
    answer.doubt = std::max(answer.doubt / sum, near * near);
  }
}

std::string whose(const FlightRows& flight, const Question& question) {
  if (question.antenna) {
    const FlightAntenna& of = flight.antennas[*question.antenna];
    return "to antenna " + std::to_string(of.antenna) + " of tag " + to_string(of.tag);
  }
  return question.anchor ? "of this anchor" : "all ranges";
}

std::string why_factor(const FlightRows& flight, const Answer& worst) {
  const ErrorFinding& found = worst.found;
  char text[400];
  if (over_limit(worst) <= 1)
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

std::string why_step(const Middle& middle, const Answer& answer) {
  const ErrorFinding& found = answer.found;
  char text[400];
  if (over_limit(answer) <= 1)
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

std::string why_drift(const Answer& answer) {
  const ErrorFinding& found = answer.found;
  char text[400];
  if (over_limit(answer) <= 1)
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

/// The factor that speaks most against the anchor; the step; the drift.
std::vector<Gate> gates_of(const FlightRows& flight, const Middle& middle, const std::vector<Answer>& answers,
                           std::size_t anchor) {
  const Answer* worst = nullptr;
  std::vector<Gate> gates(1);
  for (const Answer& answer : answers) {
    const auto gate = [&](const char* name, std::string why) {
      return Gate{name, std::abs(answer.found.value), limit_of(answer), over_limit(answer) <= 1,
                  std::move(why)};
    };
    switch (answer.question.kind) {
      case ErrorKind::step:
        gates.push_back(gate("range_step", why_step(middle, answer)));
        break;
      case ErrorKind::drift:
        gates.push_back(gate("range_drift", why_drift(answer)));
        break;
      case ErrorKind::factor:
        if (answer.question.anchor && *answer.question.anchor != anchor) break;
        if (worst && over_limit(answer) <= over_limit(*worst)) break;
        worst = &answer;
        gates.front() = gate("range_scale", why_factor(flight, answer));
        break;
    }
  }
  return gates;
}

/// Mean square of what an anchor is off by the errors there may be.
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

Result<SystematicErrors> check_systematic_errors(const FlightRows& flight, const JointFit& fit,
                                                 const SharedPrior& prior, const FlightOptions& options) {
  const Middle middle = middle_of(flight, fit.state);
  const ErrorTest::Given given{flight, fit, prior, options, middle};
  BOOST_OUTCOME_TRY(auto answers, answers_of(given));
  find_doubts(answers);
  SystematicErrors out;
  out.scale = answers[0].found;
  out.step = answers[1].found;
  out.drift = answers[2].found;
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    out.gates.push_back(gates_of(flight, middle, answers, i));
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
        "%zu of %zu anchors are less accurate because of possible systematic errors of the ranges, "
        "which this flight determines only so well: scale %.1f %%, step between low and high %.2f m, "
        "drift over the flight %.2f m (one sigma)",
        n_wider, flight.anchors.size(), 100 * out.scale.sigma, out.step.sigma, out.drift.sigma);
    out.note = text;
  }
  return out;
}

}  // namespace anchord
