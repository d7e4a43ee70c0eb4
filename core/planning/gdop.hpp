#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "core/base/result.hpp"

namespace anchord::planning {

/// Geometric dilution of precision of ranges to one anchor, both numbers people call by that name.
///
/// `trace` is tr (M^T M)^-1, eq 8.5 as the dissertation prints it; `root` is its square root, the
/// conventional GDOP: position error = root * range error. Every number that leaves anchord says which of the
/// two it is.
struct Gdop {
  double trace{};
  double root{};
};

/// M^T M counts as singular once its trace of the inverse reaches this over the number of points: some
/// direction then holds less than 1e-10 of the measurements (two sights of a pair differ by about 20
/// microradians, 2 mm at 100 m, which no receiver resolves).
inline constexpr double k_singular_trace = 1e10;

/// Nearer to the anchor than this a point has no direction (1 um; a range is never that good).
inline constexpr double k_min_distance_m = 1e-6;

template <int Dim>
using Point = Eigen::Matrix<double, Dim, 1>;
template <int Dim>
using Square = Eigen::Matrix<double, Dim, Dim>;

/// Directions from one anchor to the points where its range was (or will be) measured. Dim is 2 or 3.
///
/// M has the unit vectors of eq 8.2 as rows and no column of ones: two-way ranging has no clock unknown, so
/// the column printed in eq 8.3 belongs to satellites only. Holds N = M^T M and what a candidate needs:
///
///   tr (N + u u^T)^-1 = (c2 + tr N - u^T N u) / (det N + u^T adj(N) u)      c2: sum of the principal 2x2
///   minors
///
/// (3D; in 2D the numerator is tr N + 1). It is the rank-1 update of Sherman and Morrison multiplied out with
/// the adjugate, so that it also holds while N itself is singular: the first points of a flight. det and adj
/// come from the eigenvalues, all sums of non-negative terms, so nothing cancels.
///
/// anchor   metres, any Cartesian frame; points in the same one. When the estimate of the anchor moves, build
/// anew. accuracy 1e-9 relative against building N anew and inverting it (gdop_test.cpp, 2000 random cases)
/// threads  a value; const calls from any thread
template <int Dim>
class Geometry {
 public:
  explicit Geometry(const Point<Dim>& anchor) : anchor_(anchor) {}
  Geometry(const Point<Dim>& anchor, std::span<const Point<Dim>> points);

  /// Takes one measured point in. False (and nothing happens) when it lies on the anchor or is not finite.
  bool add(const Point<Dim>& point);

  /// errors: too_few_observations (fewer than Dim points), weak_geometry (enough points, but some direction
  /// is unseen: all on one line through the anchor, or in 3D on one plane)
  Result<Gdop> gdop() const;
  /// GDOP with one more point; the state does not change. Errors as gdop().
  Result<Gdop> with(const Point<Dim>& candidate) const;

  const Square<Dim>& normal() const { return normal_; }
  const Point<Dim>& anchor() const { return anchor_; }
  std::size_t count() const { return count_; }

  /// tr (N + u u^T)^-1 = d^T numerator d / d^T denominator d with d = candidate - anchor, |d| of any length:
  /// no square root per candidate. Singular when the quotient reaches `limit`.
  struct Update {
    Square<Dim> numerator, denominator;
    double limit{};
  };
  Update update() const;

 private:
  Point<Dim> anchor_;
  Square<Dim> normal_{Square<Dim>::Zero()};
  std::size_t count_{0};
};

extern template class Geometry<2>;
extern template class Geometry<3>;

/// Eq 8.2-8.5 for all points at once. Errors as Geometry::gdop(); points on the anchor are left out.
Result<Gdop> gdop(const Eigen::Vector3d& anchor, std::span<const Eigen::Vector3d> points);
Result<Gdop> gdop(const Eigen::Vector2d& anchor, std::span<const Eigen::Vector2d> points);

/// Traces for many candidates: structure of arrays, one quotient of two quadratic forms each, explicit
/// vectors of four (AVX2 where the machine has it, chosen at run time; the same bits come out either way).
///
/// x, y, z, trace  equally long; metres, frame of the anchor; trace[i] = +infinity where singular or not
/// finite speed           see tests/bench/planner_bench.cpp (aim: 6 ns a candidate)
void traces_with(const Geometry<3>& base, std::span<const double> x_m, std::span<const double> y_m,
                 std::span<const double> z_m, std::span<double> trace);
void traces_with(const Geometry<2>& base, std::span<const double> x_m, std::span<const double> y_m,
                 std::span<double> trace);

}  // namespace anchord::planning
