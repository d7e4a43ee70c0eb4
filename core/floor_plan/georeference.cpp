#include "core/floor_plan/georeference.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "core/base/axes.hpp"

namespace anchord::floor_plan {
namespace {

constexpr double k_deg = 180.0 / std::numbers::pi;
/// Closer pairs tell no direction: two clicks beside each other on the plan, or one corner on the map.
constexpr double k_min_spread_px = 5, k_min_spread_m = 0.5;
/// Second over first spread below this: the pairs lie on a line.
constexpr double k_min_line_ratio = 0.02;

std::string text(const char* format, double a, double b = 0) {
  char buffer[200];
  std::snprintf(buffer, sizeof buffer, format, a, b);
  return buffer;
}

std::string name_of(std::span<const PixelPair> pairs, std::size_t k) {
  return "point " + std::to_string(k + 1) + (pairs[k].name.empty() ? "" : " (" + pairs[k].name + ")");
}

int parameters(FitModel model) { return model == FitModel::helmert ? 4 : 6; }
std::size_t least_pairs(FitModel model) { return model == FitModel::helmert ? 2 : 3; }

/// Centroids, and spreads along the principal axes, the larger first.
struct Cloud {
  Eigen::Vector2d centre{0, 0}, spread{0, 0};
};
template <class Of>
Cloud cloud(std::span<const PixelPair> pairs, const Of& of) {
  Cloud out;
  const auto n = static_cast<double>(pairs.size());
  for (const auto& pair : pairs) out.centre += of(pair) / n;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const auto& pair : pairs) {
    const Eigen::Vector2d from_centre = of(pair) - out.centre;
    scatter += from_centre * from_centre.transpose() / n;
  }
  const auto eigen = axes_of<2>(scatter, Eigen::EigenvaluesOnly);
  out.spread = eigen.eigenvalues().reverse().cwiseMax(0).cwiseSqrt();
  return out;
}

Result<void> check(std::span<const PixelPair> pairs, FitModel model) {
  if (pairs.size() < least_pairs(model))
    return make_error(Errc::too_few_observations,
                      std::to_string(pairs.size()) + " points, a fit of " +
                          std::to_string(parameters(model)) + " parameters needs " +
                          std::to_string(least_pairs(model)) + ": click more points");
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (!pairs[k].pixel.allFinite() || !pairs[k].enu_m.allFinite())
      return make_error(Errc::invalid_argument, name_of(pairs, k) + " is not finite");
  }
  const auto pixels = cloud(pairs, [](const PixelPair& p) { return p.pixel; });
  const auto ground = cloud(pairs, [](const PixelPair& p) { return p.enu_m; });
  if (pixels.spread[0] < k_min_spread_px || ground.spread[0] < k_min_spread_m)
    return make_error(
        Errc::weak_geometry,
        text("the points are too close together (spread %.1f pixels, %.2f m): click corners far apart",
             pixels.spread[0], ground.spread[0]));
  if (model == FitModel::affine && (pixels.spread[1] < k_min_line_ratio * pixels.spread[0] ||
                                    ground.spread[1] < k_min_line_ratio * ground.spread[0]))
    return make_error(
        Errc::weak_geometry,
        "the points lie on one line: an affine fit needs a point off that line (or use the model helmert)");
  return boost::outcome_v2::success();
}

/// About the centroids, so that large pixel numbers and far origins cost no digits. `mirrored`: as if the
/// plan were seen from below.
PlanTransform solve(std::span<const PixelPair> pairs, FitModel model, bool mirrored = false) {
  const auto pixels = cloud(pairs, [](const PixelPair& p) { return p.pixel; });
  const auto ground = cloud(pairs, [](const PixelPair& p) { return p.enu_m; });
  PlanTransform t;
  if (model == FitModel::helmert) {
    const double down = mirrored ? 1 : -1;
    double cos_sum = 0, sin_sum = 0, square = 0;
    for (const auto& pair : pairs) {
      const Eigen::Vector2d p = pair.pixel - pixels.centre, q = pair.enu_m - ground.centre;
      const double x = p.x(), y = down * p.y();
      cos_sum += x * q.x() + y * q.y();
      sin_sum += x * q.y() - y * q.x();
      square += p.squaredNorm();
    }
    const double a = cos_sum / square, b = sin_sum / square;
    t.linear << a, -b * down, b, a * down;
  } else {
    Eigen::Matrix2d cross = Eigen::Matrix2d::Zero(), square = Eigen::Matrix2d::Zero();
    for (const auto& pair : pairs) {
      const Eigen::Vector2d p = pair.pixel - pixels.centre, q = pair.enu_m - ground.centre;
      cross += q * p.transpose();
      square += p * p.transpose();
    }
    t.linear = cross * square.inverse();
  }
  t.shift_m = ground.centre - t.linear * pixels.centre;
  return t;
}

double rms(std::span<const PixelPair> pairs, const PlanTransform& t) {
  double sum = 0;
  for (const auto& pair : pairs) sum += (pair.enu_m - t.enu_from(pair.pixel)).squaredNorm();
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

struct LeftOut {
  bool solved{false};
  double rest_rms_m{};             ///< of the others, fitted alone
  Eigen::Vector2d missed_m{0, 0};  ///< by the one left out
};

LeftOut leave_out(std::span<const PixelPair> pairs, std::size_t k, FitModel model) {
  std::vector<PixelPair> rest(pairs.begin(), pairs.end());
  rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
  LeftOut out;
  if (!check(rest, model)) return out;
  const auto t = solve(rest, model);
  out.solved = true;
  out.rest_rms_m = rms(rest, t);
  out.missed_m = pairs[k].enu_m - t.enu_from(pairs[k].pixel);
  return out;
}

/// The pair that alone explains the residuals; needs a redundancy of 3 or more.
std::optional<std::size_t> by_leaving_out(const std::vector<LeftOut>& tries, const PlanFitOptions& options) {
  std::size_t best = 0;
  double second = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < tries.size(); ++k)
    if (tries[k].rest_rms_m < tries[best].rest_rms_m) best = k;
  for (std::size_t k = 0; k < tries.size(); ++k)
    if (k != best) second = std::min(second, tries[k].rest_rms_m);
  const double missed = tries[best].missed_m.norm(), rest = tries[best].rest_rms_m;
  if (missed <= std::max(2 * options.agreement_m, 3 * rest) || second < 2 * rest) return std::nullopt;
  return best;
}

/// Of three pairs: the one whose removal leaves the other two at the known scale, where that is one alone.
std::optional<std::size_t> by_scale(std::span<const PixelPair> pairs, const PlanFitOptions& options) {
  std::optional<std::size_t> found;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto &a = pairs[(k + 1) % 3], &b = pairs[(k + 2) % 3];
    const double given = (a.enu_m - b.enu_m).norm() / (a.pixel - b.pixel).norm();
    if (std::abs(given / *options.known_scale_m_per_px - 1) > options.scale_agreement) continue;
    if (found) return std::nullopt;
    found = k;
  }
  return found;
}

void name_the_wrong(std::span<const PixelPair> pairs, const std::vector<LeftOut>& tries,
                    const PlanFitOptions& options, PlanFit& fit) {
  if (fit.redundancy <= 0) {
    fit.notes.emplace_back(
        "no redundant point: the residuals are zero by construction and prove nothing; click one more point");
    return;
  }
  double worst = 0;
  for (const auto& one : fit.residuals) worst = std::max(worst, one.residual_m.norm());
  if (worst <= options.agreement_m) {
    if (fit.redundancy < 3)
      fit.notes.emplace_back("the points agree; with a fourth point, a wrong one could be identified too");
    return;
  }
  const bool all = std::all_of(tries.begin(), tries.end(), [](const LeftOut& t) { return t.solved; });
  if (fit.redundancy > 2 && all)
    fit.wrong = by_leaving_out(tries, options);
  else if (pairs.size() == 3 && options.known_scale_m_per_px)
    fit.wrong = by_scale(pairs, options);
  if (fit.wrong) {
    const auto& missed = tries[*fit.wrong];
    fit.notes.push_back(name_of(pairs, *fit.wrong) +
                        text(" lies %.2f m from where the others put it (they agree within %.2f m): click it "
                             "again or leave it out",
                             missed.missed_m.norm(), missed.rest_rms_m));
  } else if (fit.redundancy <= 2) {
    fit.notes.push_back(
        text("the points disagree by up to %.2f m, and %.0f points cannot show which one is "
             "wrong: click another one, or give a measured length",
             worst, static_cast<double>(pairs.size())));
  } else {
    fit.notes.push_back(
        text("the points disagree by up to %.2f m (limit %.2f m), and no single one explains "
             "it: check all of them, or use the model affine if the plan is a photograph",
             worst, options.agreement_m));
  }
}

}  // namespace

Eigen::Vector2d PlanTransform::pixel_from(const Eigen::Vector2d& enu_m) const {
  return linear.inverse() * (enu_m - shift_m);
}
double PlanTransform::scale_m_per_px() const { return std::sqrt(std::abs(linear.determinant())); }
double PlanTransform::turn_deg() const { return std::atan2(linear(1, 0), linear(0, 0)) * k_deg; }

Result<PlanFit> fit_plan(std::span<const PixelPair> pairs, const PlanFitOptions& options) {
  BOOST_OUTCOME_TRYV(check(pairs, options.model));
  PlanFit fit;
  fit.model = options.model;
  fit.transform = solve(pairs, options.model);
  fit.rms_m = rms(pairs, fit.transform);
  fit.redundancy = static_cast<int>(2 * pairs.size()) - parameters(options.model);
  if (!(fit.transform.scale_m_per_px() > 0) || !fit.transform.linear.allFinite())
    return make_error(Errc::weak_geometry, "the points give no scale: are two of them swapped?");
  std::vector<LeftOut> tries;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto one = leave_out(pairs, k, options.model);
    fit.residuals.push_back({pairs[k].enu_m - fit.transform.enu_from(pairs[k].pixel),
                             one.solved ? std::optional(one.missed_m) : std::nullopt});
    tries.push_back(one);
  }
  name_the_wrong(pairs, tries, options, fit);
  if (options.model == FitModel::affine && fit.transform.linear.determinant() > 0)
    fit.notes.emplace_back("the fit mirrors the plan: are two points swapped?");
  if (options.model == FitModel::helmert && pairs.size() > 2) {
    const double over = rms(pairs, solve(pairs, options.model, true));
    if (over < 0.2 * fit.rms_m && fit.rms_m > options.agreement_m)
      fit.notes.push_back(
          text("with the plan mirrored the points fit within %.2f m instead of %.2f m: are two of them "
               "swapped, or is the plan seen from below?",
               over, fit.rms_m));
  }
  if (options.known_scale_m_per_px &&
      std::abs(fit.transform.scale_m_per_px() / *options.known_scale_m_per_px - 1) > options.scale_agreement)
    fit.notes.push_back(text("the points give %.5f m per pixel, the known length gives %.5f m per pixel",
                             fit.transform.scale_m_per_px(), *options.known_scale_m_per_px));
  return fit;
}

}  // namespace anchord::floor_plan
