#include "core/localize/range_block.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/localize/lanes.hpp"

namespace anchord {
namespace {

using namespace lanes;

ANCHORD_INLINE Four four(double value) { return Four{value, value, value, value}; }
double sum(const Four& a) { return (a[0] + a[1]) + (a[2] + a[3]); }

/// Sums over the rows, a lane each. `w` is the robust weight times the information, `c` the slope of psi
/// times the information; u the line of sight.
struct Sums {
  Four w_xx{}, w_xy{}, w_xz{}, w_yy{}, w_yz{}, w_zz{}, w_x{}, w_y{}, w_z{}, w{};
  Four g_x{}, g_y{}, g_z{}, g{};
  Four c_xx{}, c_xy{}, c_xz{}, c_yy{}, c_yz{}, c_zz{}, c_x{}, c_y{}, c_z{}, c{};
  Four bend{};  ///< of the spheres round the tags
  double rho{};
};

/// What a loss makes of e = residual over sigma: rho, weight d rho / d s, and slope of psi(e) = weight e.
template <Loss loss>
struct Shape;

template <>
struct Shape<Loss::none> {
  explicit Shape(double) {}
  ANCHORD_INLINE void at(Four e, Four& rho, Four& weight, Four& slope) const {
    rho = e * e;
    weight = slope = four(1.0);
  }
};
template <>
struct Shape<Loss::huber> {
  double bend;
  explicit Shape(double at_bend) : bend(at_bend) {}
  ANCHORD_INLINE void at(Four e, Four& rho, Four& weight, Four& slope) const {
    const Four size = e < 0.0 ? -e : e;
    const auto inside = size <= bend;
    rho = inside ? e * e : 2.0 * bend * size - bend * bend;
    weight = inside ? four(1.0) : bend / (inside ? four(1.0) : size);
    slope = inside ? four(1.0) : four(0.0);
  }
};
template <>
struct Shape<Loss::tukey> {
  double k2, inverse_k2;
  explicit Shape(double bend) : k2(bend * bend), inverse_k2(1.0 / k2) {}
  ANCHORD_INLINE void at(Four e, Four& rho, Four& weight, Four& slope) const {
    const Four s = e * e * inverse_k2;
    const Four inside = s < 1.0 ? 1.0 - s : four(0.0);
    rho = k2 / 3.0 * (1.0 - inside * inside * inside);
    weight = inside * inside;
    slope = s < 1.0 ? inside * (1.0 - 5.0 * s) : four(0.0);
  }
};
template <>
struct Shape<Loss::cauchy> {
  double k2, inverse_k2;
  explicit Shape(double bend) : k2(bend * bend), inverse_k2(1.0 / k2) {}
  /// rho is what its logarithm is taken of: 1 + s.
  ANCHORD_INLINE void at(Four e, Four& rho, Four& weight, Four& slope) const {
    const Four s = e * e * inverse_k2;
    rho = 1.0 + s;
    weight = 1.0 / rho;
    slope = (1.0 - s) * weight * weight;
  }
};

struct Rows {
  const double *x_m, *y_m, *z_m, *distance_m, *inverse_sigma, *factor2;
  std::size_t count;  ///< whole groups
  bool one_factor;
};

/// What some rows add to the sums, before it is multiplied out. Roots and quotients wait for one another
/// within a row; where nothing else is done between, those of several rows are under way at once.
struct Terms {
  static constexpr std::size_t most = 64;
  using Numbers = std::array<double, most>;
  alignas(32) Numbers ux, uy, uz, w, c, pull, sphere, rho;
};

/// The sum of rho.
template <Loss loss>
class Cost {
 public:
  Cost(double, bool) {}
  ANCHORD_INLINE void add(const Terms& terms, std::size_t n, const double* factor2) {
    for (std::size_t k = 0; k < n; k += k_lanes) total_ += load(factor2 + k) * load(&terms.rho[k]);
  }
  double rho() const { return sum(total_); }

 private:
  Four total_{};
};
/// Of Cauchy's: one logarithm of a product of many, where no row has a factor of its own.
template <>
class Cost<Loss::cauchy> {
 public:
  Cost(double bend, bool one_factor) : k2_(bend * bend), one_factor_(one_factor) {}
  ANCHORD_INLINE void add(const Terms& terms, std::size_t n, const double* factor2) {
    if (!one_factor_) {
      for (std::size_t i = 0; i < n; ++i) total_ += factor2[i] * std::log(terms.rho[i]);
      return;
    }
    Four most{}, product = four(1.0);
    for (std::size_t k = 0; k < n; k += k_lanes) {
      const Four rho = load(&terms.rho[k]);
      most = rho > most ? rho : most;
      product *= rho;
    }
    // So many below 1e9 multiply to less than the largest number there is.
    static_assert(Terms::most / k_lanes <= 16);
    bool modest = true;
    for (std::size_t i = 0; i < k_lanes; ++i) modest = modest && most[i] < 1e9;
    if (modest) {
      for (std::size_t i = 0; i < k_lanes; ++i) total_ += std::log(product[i]);
    } else {
      for (std::size_t i = 0; i < n; ++i) total_ += std::log(terms.rho[i]);
    }
  }
  double rho() const { return k2_ * total_; }

 private:
  double k2_, total_{0};
  bool one_factor_;
};

template <Loss loss>
ANCHORD_INLINE void find_terms(const Rows& rows, std::size_t begin, std::size_t n, const Unknowns& at,
                               const Shape<loss>& shape, Terms& out) {
  for (std::size_t k = 0; k < n; k += k_lanes) {
    const std::size_t i = begin + k;
    const Four x = at[0] - load(rows.x_m + i), y = at[1] - load(rows.y_m + i), z = at[2] - load(rows.z_m + i);
    const Four distance = root(x * x + y * y + z * z);
    // On the tag itself there is no direction; any unit vector is a subgradient, up is as good as another.
    const auto apart = distance > 1e-9;
    const Four inverse = 1.0 / (apart ? distance : four(1.0));
    const Four inverse_sigma = load(rows.inverse_sigma + i), factor2 = load(rows.factor2 + i);
    const Four e_m = load(rows.distance_m + i) - distance - at[3];
    Four rho, weight, slope;
    shape.at(e_m * inverse_sigma, rho, weight, slope);
    const Four information = factor2 * inverse_sigma * inverse_sigma;
    const Four w = weight * information, pull = w * e_m;
    store(&out.ux[k], apart ? x * inverse : four(0.0));
    store(&out.uy[k], apart ? y * inverse : four(0.0));
    store(&out.uz[k], apart ? z * inverse : four(1.0));
    store(&out.w[k], w);
    store(&out.c[k], slope * information);
    store(&out.pull[k], pull);
    // The sphere round the tag bends: d2 |a - q| = (I - u u^T) / |a - q|.
    store(&out.sphere[k], distance > 1e-3 ? pull * inverse : four(0.0));
    store(&out.rho[k], rho);
  }
}

ANCHORD_INLINE void multiply(const Terms& t, std::size_t n, Sums& s) {
  for (std::size_t k = 0; k < n; k += k_lanes) {
    const Four ux = load(&t.ux[k]), uy = load(&t.uy[k]), uz = load(&t.uz[k]), w = load(&t.w[k]);
    const Four wx = w * ux, wy = w * uy, wz = w * uz;
    s.w_xx += wx * ux;
    s.w_xy += wx * uy;
    s.w_xz += wx * uz;
    s.w_yy += wy * uy;
    s.w_yz += wy * uz;
    s.w_zz += wz * uz;
    s.w_x += wx;
    s.w_y += wy;
    s.w_z += wz;
    s.w += w;
  }
  for (std::size_t k = 0; k < n; k += k_lanes) {
    const Four ux = load(&t.ux[k]), uy = load(&t.uy[k]), uz = load(&t.uz[k]), pull = load(&t.pull[k]);
    const Four c = load(&t.c[k]);
    s.g_x += pull * ux;
    s.g_y += pull * uy;
    s.g_z += pull * uz;
    s.g += pull;
    s.c_x += c * ux;
    s.c_y += c * uy;
    s.c_z += c * uz;
    s.c += c;
  }
  for (std::size_t k = 0; k < n; k += k_lanes) {
    const Four ux = load(&t.ux[k]), uy = load(&t.uy[k]), uz = load(&t.uz[k]), sphere = load(&t.sphere[k]);
    const Four cs = load(&t.c[k]) + sphere, cx = cs * ux, cy = cs * uy, cz = cs * uz;
    s.c_xx += cx * ux;
    s.c_xy += cx * uy;
    s.c_xz += cx * uz;
    s.c_yy += cy * uy;
    s.c_yz += cy * uz;
    s.c_zz += cz * uz;
    s.bend += sphere;
  }
}

template <Loss loss>
ANCHORD_INLINE void add_rows(const Rows& rows, const Unknowns& at, double bend, Sums& out) {
  const Shape<loss> shape(bend);
  Cost<loss> cost(bend, rows.one_factor);
  Sums s;
  Terms terms;
  for (std::size_t begin = 0; begin < rows.count; begin += Terms::most) {
    const std::size_t n = std::min(Terms::most, rows.count - begin);
    find_terms(rows, begin, n, at, shape, terms);
    cost.add(terms, n, rows.factor2 + begin);
    multiply(terms, n, s);
  }
  s.rho = cost.rho();
  out = s;
}

ANCHORD_INLINE void add_rows(Loss loss, const Rows& rows, const Unknowns& at, double bend, Sums& out) {
  switch (loss) {
    case Loss::none:
      return add_rows<Loss::none>(rows, at, bend, out);
    case Loss::huber:
      return add_rows<Loss::huber>(rows, at, bend, out);
    case Loss::cauchy:
      return add_rows<Loss::cauchy>(rows, at, bend, out);
    case Loss::tukey:
      return add_rows<Loss::tukey>(rows, at, bend, out);
  }
}

/// What the tags' covariances say along the lines of sight.
struct ScaleRows {
  const double *x_m, *y_m, *z_m, *sigma2_m2;
  std::array<const double*, 6> covariance_m2;
  std::size_t count;
};

ANCHORD_INLINE void project(const ScaleRows& rows, const Unknowns& at, double* inverse_sigma) {
  const auto& c = rows.covariance_m2;
  for (std::size_t i = 0; i < rows.count; i += k_lanes) {
    const Four x = at[0] - load(rows.x_m + i), y = at[1] - load(rows.y_m + i), z = at[2] - load(rows.z_m + i);
    const Four distance2 = x * x + y * y + z * z;
    const auto apart = distance2 > 1e-18;
    const Four along = x * (x * load(c[0] + i) + 2.0 * (y * load(c[1] + i) + z * load(c[2] + i))) +
                       y * (y * load(c[3] + i) + 2.0 * z * load(c[4] + i)) + z * z * load(c[5] + i);
    const Four variance = apart ? along / (apart ? distance2 : four(1.0)) : load(c[5] + i);
    const Four inverse = 1.0 / root(load(rows.sigma2_m2 + i) + (variance > 0.0 ? variance : four(0.0)));
    store(inverse_sigma + i, inverse);
  }
}

void add_rows_plain(Loss loss, const Rows& rows, const Unknowns& at, double bend, Sums& out) {
  add_rows(loss, rows, at, bend, out);
}
void project_plain(const ScaleRows& rows, const Unknowns& at, double* inverse_sigma) {
  project(rows, at, inverse_sigma);
}
#if defined(__x86_64__)
__attribute__((target("avx2"))) void add_rows_avx2(Loss loss, const Rows& rows, const Unknowns& at,
                                                   double bend, Sums& out) {
  add_rows(loss, rows, at, bend, out);
}
__attribute__((target("avx2"))) void project_avx2(const ScaleRows& rows, const Unknowns& at,
                                                  double* inverse_sigma) {
  project(rows, at, inverse_sigma);
}
const bool k_avx2 = __builtin_cpu_supports("avx2") != 0;
#else
constexpr bool k_avx2 = false;
constexpr auto add_rows_avx2 = add_rows_plain;
constexpr auto project_avx2 = project_plain;
#endif

/// Of xx, xy, xz, x, yy, yz, y, zz, z, 1.
Eigen::Matrix4d symmetric(const std::array<Four, 10>& sums) {
  std::array<double, 10> v;
  std::ranges::transform(sums, v.begin(), sum);
  Eigen::Matrix4d m;
  m << v[0], v[1], v[2], v[3], v[1], v[4], v[5], v[6], v[2], v[5], v[7], v[8], v[3], v[6], v[8], v[9];
  return m;
}

}  // namespace

RangeBlock::RangeBlock(std::span<const Observation> observations)
    : observations_(observations),
      // A ball looks the same from everywhere.
      one_scale_(std::ranges::all_of(observations, [](const Observation& o) {
        return o.tag_covariance_m2 == o.tag_covariance_m2(0, 0) * Eigen::Matrix3d::Identity();
      })) {
  const std::size_t n = observations.size(), padded = (n + k_lanes - 1) / k_lanes * k_lanes;
  for (auto* column : {&x_m_, &y_m_, &z_m_, &distance_m_, &inverse_sigma_, &factor2_}) column->resize(padded);
  sigma2_m2_.resize(padded, 1.0);
  if (!one_scale_) {
    for (auto& column : covariance_m2_) column.resize(padded);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const Observation& o = observations[i];
    x_m_[i] = o.tag_m.x();
    y_m_[i] = o.tag_m.y();
    z_m_[i] = o.tag_m.z();
    distance_m_[i] = o.distance_m;
    sigma2_m2_[i] = o.sigma_m * o.sigma_m + (one_scale_ ? std::max(o.tag_covariance_m2(0, 0), 0.0) : 0.0);
    if (one_scale_) continue;
    constexpr std::array<std::pair<int, int>, 6> places{{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};
    for (std::size_t k = 0; k < places.size(); ++k)
      covariance_m2_[k][i] = o.tag_covariance_m2(places[k].first, places[k].second);
  }
}

void RangeBlock::scale(const Unknowns& at, Weights weights) {
  if (one_scale_ && scaled_ == weights) return;
  scaled_ = weights;
  one_factor_ = weights != Weights::as_printed;
  const std::size_t n = observations_.size();
  if (one_scale_) {
    for (std::size_t i = 0; i < n; ++i) inverse_sigma_[i] = 1.0 / std::sqrt(sigma2_m2_[i]);
  } else {
    ScaleRows rows{x_m_.data(), y_m_.data(), z_m_.data(), sigma2_m2_.data(), {}, x_m_.size()};
    for (std::size_t k = 0; k < rows.covariance_m2.size(); ++k)
      rows.covariance_m2[k] = covariance_m2_[k].data();
    (k_avx2 ? project_avx2 : project_plain)(rows, at, inverse_sigma_.data());
    std::fill(inverse_sigma_.begin() + static_cast<std::ptrdiff_t>(n), inverse_sigma_.end(), 0.0);
  }
  // Eq 7.11: W = 1 / s, so m^2 = s.
  for (std::size_t i = 0; i < n; ++i) factor2_[i] = one_factor_ ? 1.0 : 1.0 / inverse_sigma_[i];
}

std::vector<double> RangeBlock::residuals_m(const Unknowns& at) const {
  std::vector<double> out(observations_.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double x = at[0] - x_m_[i], y = at[1] - y_m_[i], z = at[2] - z_m_[i];
    out[i] = distance_m_[i] - std::sqrt(x * x + y * y + z * z) - at[3];
  }
  return out;
}

RangeNormal RangeBlock::normal(const Unknowns& at, Loss loss, double bend, Registers registers) const {
  const Rows rows{x_m_.data(),           y_m_.data(),     z_m_.data(), distance_m_.data(),
                  inverse_sigma_.data(), factor2_.data(), x_m_.size(), one_factor_};
  Sums s;
  (registers == Registers::widest && k_avx2 ? add_rows_avx2 : add_rows_plain)(loss, rows, at, bend, s);
  RangeNormal n;
  n.matrix = symmetric({s.w_xx, s.w_xy, s.w_xz, s.w_x, s.w_yy, s.w_yz, s.w_y, s.w_zz, s.w_z, s.w});
  n.curvature = symmetric({s.c_xx, s.c_xy, s.c_xz, s.c_x, s.c_yy, s.c_yz, s.c_y, s.c_zz, s.c_z, s.c});
  n.curvature.topLeftCorner<3, 3>().diagonal().array() -= sum(s.bend);
  n.gradient << sum(s.g_x), sum(s.g_y), sum(s.g_z), sum(s.g);
  n.cost = 0.5 * s.rho;
  return n;
}

}  // namespace anchord
