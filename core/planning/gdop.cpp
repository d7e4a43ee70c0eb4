#include "core/planning/gdop.hpp"

#include <cmath>
#include <string>

#include "core/base/axes.hpp"

namespace anchord::planning {
namespace {

Error too_few(std::size_t count, int dim) {
  return make_error(Errc::too_few_observations,
                    "too few points for GDOP: " + std::to_string(count) + ", need " + std::to_string(dim));
}

template <int Dim>
Error unseen_direction(std::size_t count) {
  const std::string what = Dim == 2 ? "on one line through the anchor" : "in one plane through the anchor";
  return make_error(Errc::weak_geometry,
                    "singular geometry: the " + std::to_string(count) + " points lie " + what);
}

/// tr N^-1 from the eigenvalues; +infinity when singular.
template <int Dim>
double trace_of_inverse(const Square<Dim>& normal, std::size_t count) {
  const auto eigen = axes_of<Dim>(normal, Eigen::EigenvaluesOnly);
  if (!(eigen.eigenvalues()[0] > 0)) return INFINITY;
  const double trace = eigen.eigenvalues().cwiseInverse().sum();
  return trace < k_singular_trace / static_cast<double>(count) ? trace : INFINITY;
}

}  // namespace

template <int Dim>
Geometry<Dim>::Geometry(const Point<Dim>& anchor, std::span<const Point<Dim>> points) : anchor_(anchor) {
  for (const auto& point : points) add(point);
}

template <int Dim>
bool Geometry<Dim>::add(const Point<Dim>& point) {
  const Point<Dim> d = point - anchor_;
  const double squared = d.squaredNorm();
  if (!(squared > k_min_distance_m * k_min_distance_m) || !std::isfinite(squared)) return false;
  normal_ += d * d.transpose() / squared;
  ++count_;
  return true;
}

template <int Dim>
Result<Gdop> Geometry<Dim>::gdop() const {
  if (count_ < Dim) return too_few(count_, Dim);
  const double trace = trace_of_inverse<Dim>(normal_, count_);
  if (!std::isfinite(trace)) return unseen_direction<Dim>(count_);
  return Gdop{trace, std::sqrt(trace)};
}

template <int Dim>
Result<Gdop> Geometry<Dim>::with(const Point<Dim>& candidate) const {
  if (count_ + 1 < Dim) return too_few(count_ + 1, Dim);
  const Update u = update();
  const Point<Dim> d = candidate - anchor_;
  if (!(d.squaredNorm() > k_min_distance_m * k_min_distance_m)) {
    return make_error(Errc::weak_geometry, "the candidate lies on the anchor and has no direction");
  }
  const double numerator = d.dot(u.numerator * d);
  const double denominator = d.dot(u.denominator * d);
  if (!(numerator < u.limit * denominator)) return unseen_direction<Dim>(count_ + 1);
  const double trace = numerator / denominator;
  return Gdop{trace, std::sqrt(trace)};
}

template <int Dim>
typename Geometry<Dim>::Update Geometry<Dim>::update() const {
  const auto eigen = axes_of<Dim>(normal_);
  const Point<Dim> l = eigen.eigenvalues().cwiseMax(0.0);  // rounding may push a zero below zero
  const Square<Dim>& q = eigen.eigenvectors();
  Point<Dim> adjugate, numerator;
  double det = 0;
  if constexpr (Dim == 2) {
    det = l[0] * l[1];
    adjugate = {l[1], l[0]};
    numerator.setConstant(l[0] + l[1] + 1.0);  // u^T u = 1
  } else {
    det = l[0] * l[1] * l[2];
    adjugate = {l[1] * l[2], l[0] * l[2], l[0] * l[1]};
    const double minors = adjugate.sum();
    numerator = {minors + l[1] + l[2], minors + l[0] + l[2], minors + l[0] + l[1]};  // c2 + tr N - N
  }
  Update out;
  out.numerator = q * numerator.asDiagonal() * q.transpose();
  out.denominator = q * (adjugate.array() + det).matrix().asDiagonal() * q.transpose();
  out.limit = k_singular_trace / static_cast<double>(count_ + 1);
  return out;
}

template class Geometry<2>;
template class Geometry<3>;

Result<Gdop> gdop(const Eigen::Vector3d& anchor, std::span<const Eigen::Vector3d> points) {
  return Geometry<3>(anchor, points).gdop();
}
Result<Gdop> gdop(const Eigen::Vector2d& anchor, std::span<const Eigen::Vector2d> points) {
  return Geometry<2>(anchor, points).gdop();
}

}  // namespace anchord::planning
