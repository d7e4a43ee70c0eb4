#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/base/check.hpp"
#include "core/planning/gdop.hpp"

// No fused multiply-add in here: the AVX2 and the plain version must give the same bits, so that a decision
// replayed on another machine is the same decision.

namespace anchord::planning {
namespace {

/// Coefficients of the two quadratic forms: xx, yy, zz, 2 xy, 2 xz, 2 yz.
struct Forms {
  std::array<double, 6> n, d;
  double ax, ay, az, limit;
};

struct Columns {
  const double* x;
  const double* y;
  const double* z;  ///< null in 2D
  double* out;
};

inline double quotient(const Forms& f, double x, double y, double z) {
  const double dx = x - f.ax, dy = y - f.ay, dz = z - f.az;
  const double xx = dx * dx, yy = dy * dy, zz = dz * dz, xy = dx * dy, xz = dx * dz, yz = dy * dz;
  const double n = ((f.n[0] * xx + f.n[1] * yy) + (f.n[2] * zz + f.n[3] * xy)) + (f.n[4] * xz + f.n[5] * yz);
  const double d = ((f.d[0] * xx + f.d[1] * yy) + (f.d[2] * zz + f.d[3] * xy)) + (f.d[4] * xz + f.d[5] * yz);
  return n < f.limit * d ? n / d : std::numeric_limits<double>::infinity();
}

void plain(const Forms& f, const Columns& c, std::size_t from, std::size_t to) {
  for (std::size_t i = from; i < to; ++i) c.out[i] = quotient(f, c.x[i], c.y[i], c.z ? c.z[i] : f.az);
}

#if defined(__x86_64__)
using V4 = double __attribute__((vector_size(32)));

__attribute__((target("avx2"))) std::size_t avx2(const Forms& f, const Columns& c, std::size_t size) {
  const double inf = std::numeric_limits<double>::infinity();
  const V4 infinite = {inf, inf, inf, inf};
  std::size_t i = 0;
  for (; i + 4 <= size; i += 4) {
    V4 x, y, z = {f.az, f.az, f.az, f.az};
    std::memcpy(&x, c.x + i, sizeof x);
    std::memcpy(&y, c.y + i, sizeof y);
    if (c.z) std::memcpy(&z, c.z + i, sizeof z);
    const V4 dx = x - f.ax, dy = y - f.ay, dz = z - f.az;
    const V4 xx = dx * dx, yy = dy * dy, zz = dz * dz, xy = dx * dy, xz = dx * dz, yz = dy * dz;
    const V4 n = ((f.n[0] * xx + f.n[1] * yy) + (f.n[2] * zz + f.n[3] * xy)) + (f.n[4] * xz + f.n[5] * yz);
    const V4 d = ((f.d[0] * xx + f.d[1] * yy) + (f.d[2] * zz + f.d[3] * xy)) + (f.d[4] * xz + f.d[5] * yz);
    const V4 value = n < f.limit * d ? n / d : infinite;
    std::memcpy(c.out + i, &value, sizeof value);
  }
  return i;
}
#endif

void run(const Forms& f, const Columns& c, std::size_t size) {
  std::size_t done = 0;
#if defined(__x86_64__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) done = avx2(f, c, size);
#endif
  plain(f, c, done, size);
}

std::array<double, 6> coefficients(const Eigen::Matrix3d& m) {
  return {m(0, 0), m(1, 1), m(2, 2), 2 * m(0, 1), 2 * m(0, 2), 2 * m(1, 2)};
}

template <int Dim>
Forms forms_of(const Geometry<Dim>& base) {
  const auto update = base.update();
  Eigen::Matrix3d n = Eigen::Matrix3d::Zero(), d = Eigen::Matrix3d::Zero();
  n.template topLeftCorner<Dim, Dim>() = update.numerator;
  d.template topLeftCorner<Dim, Dim>() = update.denominator;
  return {coefficients(n),
          coefficients(d),
          base.anchor()[0],
          base.anchor()[1],
          Dim == 3 ? base.anchor()[Dim - 1] : 0.0,
          update.limit};
}

}  // namespace

void traces_with(const Geometry<3>& base, std::span<const double> x_m, std::span<const double> y_m,
                 std::span<const double> z_m, std::span<double> trace) {
  ANCHORD_CHECK(x_m.size() == y_m.size() && y_m.size() == z_m.size() && z_m.size() == trace.size(),
                "columns of different length: " << x_m.size() << " and " << trace.size());
  run(forms_of(base), {x_m.data(), y_m.data(), z_m.data(), trace.data()}, trace.size());
}

void traces_with(const Geometry<2>& base, std::span<const double> x_m, std::span<const double> y_m,
                 std::span<double> trace) {
  ANCHORD_CHECK(x_m.size() == y_m.size() && y_m.size() == trace.size(),
                "columns of different length: " << x_m.size() << " and " << trace.size());
  run(forms_of(base), {x_m.data(), y_m.data(), nullptr, trace.data()}, trace.size());
}

}  // namespace anchord::planning
