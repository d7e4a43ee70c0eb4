#include "core/localize/joint_lines.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

// Vectors pass between functions here, all of which are inlined; nobody else sees how.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace anchord {
namespace {

constexpr std::size_t k_lanes = 4;
/// Four doubles and the arithmetic of one: two SSE2 registers or one of AVX2, the same operations in either.
using Four = double __attribute__((vector_size(k_lanes * sizeof(double))));
#define ANCHORD_LINES_INLINE inline __attribute__((always_inline))

ANCHORD_LINES_INLINE Four load(const double* from) {
  Four out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
ANCHORD_LINES_INLINE void store(double* to, Four value) { std::memcpy(to, &value, sizeof value); }
ANCHORD_LINES_INLINE Four root(Four a) {
  Four out;
  for (std::size_t i = 0; i < k_lanes; ++i) out[i] = __builtin_sqrt(a[i]);
  return out;
}

/// Some rows on their way: where the antenna was, and what its place depends on.
struct Places {
  static constexpr std::size_t most = 64;
  using Numbers = std::array<double, most>;
  Numbers distance_m, up_m, x_m, y_m, z_m, vx_mps, vy_mps, vz_mps, xx_m2, xy_m2, xz_m2, yy_m2, yz_m2, zz_m2;
  Numbers ux, uy, uz, fx, fy, fz, lx, ly, lz;  ///< axes of the body, where it is not level
  std::size_t n{0};
  bool level{true};  ///< all of them: no attitude is known

  void add(const TrackInterval& in, double t_s, const JointRow& row, double arm_up_m) {
    const TrackPose &before = *in.before, &later = *in.later;
    distance_m[n] = row.distance_m;
    up_m[n] = arm_up_m;
    const double interval_s = later.t_s - before.t_s;
    const double share = interval_s > 0 ? (t_s - before.t_s) / interval_s : 0.0, rest = 1.0 - share;
    const auto between = [&](int i, int j) {
      return rest * before.covariance_m2(i, j) + share * later.covariance_m2(i, j);
    };
    const double missed_m2 = in.missed_m * in.missed_m;
    xx_m2[n] = between(0, 0) + missed_m2;
    yy_m2[n] = between(1, 1) + missed_m2;
    zz_m2[n] = between(2, 2) + missed_m2;
    xy_m2[n] = between(0, 1) + between(1, 0);
    xz_m2[n] = between(0, 2) + between(2, 0);
    yz_m2[n] = between(1, 2) + between(2, 1);
    if (before.attitude && later.attitude) {
      turn(interpolate(before, later, t_s, row.lever_arm_body_m));
    } else {
      const Eigen::Vector3d &p = before.position_m, &q = later.position_m;
      const double per_s = interval_s > 0 ? 1.0 / interval_s : 0.0;
      x_m[n] = rest * p.x() + share * q.x();
      y_m[n] = rest * p.y() + share * q.y();
      z_m[n] = rest * p.z() + share * q.z() + row.lever_arm_body_m.z();
      vx_mps[n] = (q.x() - p.x()) * per_s;
      vy_mps[n] = (q.y() - p.y()) * per_s;
      vz_mps[n] = (q.z() - p.z()) * per_s;
      set_axes({0, 0, 1}, {0, 0, 0}, {0, 0, 0});
    }
    ++n;
  }
  /// The last ones again, up to a whole group: they are not read.
  void fill_group() {
    for (std::size_t to = n; n > 0 && to % k_lanes != 0; ++to)
      for (Numbers* numbers :
           {&distance_m, &up_m,  &x_m, &y_m, &z_m, &vx_mps, &vy_mps, &vz_mps, &xx_m2, &xy_m2, &xz_m2, &yy_m2,
            &yz_m2,      &zz_m2, &ux,  &uy,  &uz,  &fx,     &fy,     &fz,     &lx,    &ly,    &lz})
        (*numbers)[to] = (*numbers)[n - 1];
  }

 private:
  void turn(const TagPoint& point) {
    level = false;
    x_m[n] = point.position_m.x();
    y_m[n] = point.position_m.y();
    z_m[n] = point.position_m.z();
    vx_mps[n] = point.velocity_mps.x();
    vy_mps[n] = point.velocity_mps.y();
    vz_mps[n] = point.velocity_mps.z();
    set_axes(point.body_up, point.body_forward, point.body_left);
  }
  void set_axes(const Eigen::Vector3d& up, const Eigen::Vector3d& ahead, const Eigen::Vector3d& aside) {
    ux[n] = up.x();
    uy[n] = up.y();
    uz[n] = up.z();
    fx[n] = ahead.x();
    fy[n] = ahead.y();
    fz[n] = ahead.z();
    lx[n] = aside.x();
    ly[n] = aside.y();
    lz[n] = aside.z();
  }
};

/// What the lines of some rows depend on beside their places.
struct At {
  Eigen::Vector3d anchor_m;
  double offset_m, curve_m, forward_m, left_m;  ///< offset: bias and delay
};

struct Columns {
  std::array<double*, JointLines::n_columns> to;
};

/// Lines of sight and distances first, then what follows from the curve at them.
ANCHORD_LINES_INLINE void aim(const At& at, Places& p, Places::Numbers& far_m, const Columns& out) {
  for (std::size_t i = 0; i < p.n; i += k_lanes) {
    const Four up_m = load(&p.up_m[i]);
    Four x = load(&p.x_m[i]), y = load(&p.y_m[i]), z = load(&p.z_m[i]);
    if (p.level) {
      z += up_m;
    } else {
      x += up_m * load(&p.ux[i]) + at.forward_m * load(&p.fx[i]) + at.left_m * load(&p.lx[i]);
      y += up_m * load(&p.uy[i]) + at.forward_m * load(&p.fy[i]) + at.left_m * load(&p.ly[i]);
      z += up_m * load(&p.uz[i]) + at.forward_m * load(&p.fz[i]) + at.left_m * load(&p.lz[i]);
    }
    store(out.to[JointLines::antenna_x] + i, x);
    store(out.to[JointLines::antenna_y] + i, y);
    store(out.to[JointLines::antenna_z] + i, z);
    x -= at.anchor_m[0];
    y -= at.anchor_m[1];
    z -= at.anchor_m[2];
    const Four length = root(x * x + y * y + z * z);
    const Four distance = length < 1e-6 ? Four{1e-6, 1e-6, 1e-6, 1e-6} : length;
    const Four inverse = 1.0 / distance;
    store(&p.x_m[i], x * inverse);
    store(&p.y_m[i], y * inverse);
    store(&p.z_m[i], z * inverse);
    store(&far_m[i], distance);
  }
}
ANCHORD_LINES_INLINE void derive(const At& at, const Places& p, const Places::Numbers& far_m,
                                 const Places::Numbers& curve, const Places::Numbers& slope,
                                 const Columns& out) {
  const Four nothing{};
  for (std::size_t i = 0; i < p.n; i += k_lanes) {
    const Four x = load(&p.x_m[i]), y = load(&p.y_m[i]), z = load(&p.z_m[i]), s = load(&slope[i]);
    const auto along = [&](const Places::Numbers& a, const Places::Numbers& b, const Places::Numbers& c) {
      return s * (x * load(&a[i]) + y * load(&b[i]) + z * load(&c[i]));
    };
    store(out.to[JointLines::x] + i, -s * x);
    store(out.to[JointLines::y] + i, -s * y);
    store(out.to[JointLines::z] + i, -s * z);
    store(out.to[JointLines::curve] + i, load(&curve[i]));
    store(out.to[JointLines::lag] + i, along(p.vx_mps, p.vy_mps, p.vz_mps));
    store(out.to[JointLines::lever] + i, p.level ? s * z : along(p.ux, p.uy, p.uz));
    store(out.to[JointLines::forward] + i, p.level ? nothing : along(p.fx, p.fy, p.fz));
    store(out.to[JointLines::left] + i, p.level ? nothing : along(p.lx, p.ly, p.lz));
    store(out.to[JointLines::residual] + i,
          load(&p.distance_m[i]) - (load(&far_m[i]) + at.offset_m + at.curve_m * load(&curve[i])));
    const Four variance = x * (x * load(&p.xx_m2[i]) + y * load(&p.xy_m2[i]) + z * load(&p.xz_m2[i])) +
                          y * (y * load(&p.yy_m2[i]) + z * load(&p.yz_m2[i])) + z * z * load(&p.zz_m2[i]);
    store(out.to[JointLines::variance] + i, variance < 0.0 ? nothing : variance);
  }
}

/// Sums of the products of columns two by two, row by row of the upper half. As many as find room in
/// registers are summed while all rows pass.
struct Products {
  std::span<const double* const> columns;
  const double* weights;
  std::size_t padded;
  double* out;
};
constexpr std::size_t k_most_sums = 10;
/// One column by `many`.
template <std::size_t many>
ANCHORD_LINES_INLINE void multiply_by(const double* column, const double* const* columns, const Products& p,
                                      double* out) {
  std::array<Four, many> sums{};
  for (std::size_t i = 0; i < p.padded; i += k_lanes) {
    const Four weighed = load(p.weights + i) * load(column + i);
    for (std::size_t j = 0; j < many; ++j) sums[j] += weighed * load(columns[j] + i);
  }
  for (std::size_t j = 0; j < many; ++j) out[j] = (sums[j][0] + sums[j][1]) + (sums[j][2] + sums[j][3]);
}
template <std::size_t... many>
ANCHORD_LINES_INLINE void multiply_by_first(std::size_t n, const double* column, const double* const* columns,
                                            const Products& p, double* out, std::index_sequence<many...>) {
  (void)((n == many + 1 && (multiply_by<many + 1>(column, columns, p, out), true)) || ...);
}
ANCHORD_LINES_INLINE void multiply(const Products& p) {
  double* out = p.out;
  for (std::size_t i = 0; i < p.columns.size(); ++i)
    for (std::size_t j = i; j < p.columns.size(); j += k_most_sums) {
      const std::size_t n = std::min(k_most_sums, p.columns.size() - j);
      multiply_by_first(n, p.columns[i], &p.columns[j], p, out, std::make_index_sequence<k_most_sums>());
      out += n;
    }
}
ANCHORD_LINES_INLINE void weigh(const JointLines& lines, double variance_m2, double usual_m2, double cut_off,
                                double* to) {
  const double inverse_cut = 1.0 / (cut_off * cut_off);
  const Four nothing{};
  for (std::size_t i = 0; i < lines.padded(); i += k_lanes) {
    const Four residual_m = load(lines.begin(JointLines::residual) + i);
    const Four beyond_m2 = load(lines.begin(JointLines::variance) + i) - usual_m2;
    const Four inverse = 1.0 / (variance_m2 + (beyond_m2 < 0.0 ? nothing : beyond_m2));
    const Four inside = 1.0 - residual_m * residual_m * inverse * inverse_cut;
    // A residual that is no number weighs none either, and shows in the sums.
    store(to + i, inside <= 0.0 ? nothing : inside * inside * (variance_m2 * inverse));
  }
}

void aim_plain(const At& at, Places& p, Places::Numbers& far_m, const Columns& out) {
  aim(at, p, far_m, out);
}
void derive_plain(const At& at, const Places& p, const Places::Numbers& far_m, const Places::Numbers& curve,
                  const Places::Numbers& slope, const Columns& out) {
  derive(at, p, far_m, curve, slope, out);
}
void multiply_plain(const Products& products) { multiply(products); }
void weigh_plain(const JointLines& lines, double variance_m2, double usual_m2, double cut_off, double* to) {
  weigh(lines, variance_m2, usual_m2, cut_off, to);
}
#if defined(__x86_64__)
__attribute__((target("avx2"))) void aim_avx2(const At& at, Places& p, Places::Numbers& far_m,
                                              const Columns& out) {
  aim(at, p, far_m, out);
}
__attribute__((target("avx2"))) void derive_avx2(const At& at, const Places& p, const Places::Numbers& far_m,
                                                 const Places::Numbers& curve, const Places::Numbers& slope,
                                                 const Columns& out) {
  derive(at, p, far_m, curve, slope, out);
}
__attribute__((target("avx2"))) void multiply_avx2(const Products& products) { multiply(products); }
__attribute__((target("avx2"))) void weigh_avx2(const JointLines& lines, double variance_m2, double usual_m2,
                                                double cut_off, double* to) {
  weigh(lines, variance_m2, usual_m2, cut_off, to);
}
const bool k_wide = __builtin_cpu_supports("avx2") != 0;
#else
constexpr bool k_wide = false;
constexpr auto aim_avx2 = aim_plain;
constexpr auto derive_avx2 = derive_plain;
constexpr auto multiply_avx2 = multiply_plain;
constexpr auto weigh_avx2 = weigh_plain;
#endif

constexpr int k_summed = 10;
using Summed = Eigen::Matrix<double, k_summed, k_summed>;

/// Into the blocks; arm: of the antenna, if it has one of its own.
void add_sums(const Summed& all, const JointRow& row, AnchorBlock& block, JointNormal& normal) {
  constexpr int residual = k_summed - 1;
  static_assert(k_shared_bias == 0 && k_shared_left == 5 && k_shared_antennas == 6);
  // Column of the sums that each shared unknown has.
  std::array<int, k_shared_size> column{3, 4, 5, 6, 7, 8, -1, -1, -1, -1};
  if (row.arm) column[static_cast<std::size_t>(k_shared_antennas + *row.arm)] = 6;
  block.own += all.topLeftCorner<4, 4>();
  block.gradient += all.block<4, 1>(0, residual);
  for (int j = 0; j < k_shared_size; ++j) {
    const int cj = column[static_cast<std::size_t>(j)];
    if (cj < 0) continue;
    for (int i = 0; i < 4; ++i) block.shared(i, j) += all(i, cj);
    normal.shared_gradient[j] += all(cj, residual);
    for (int i = 0; i < k_shared_size; ++i) {
      const int ci = column[static_cast<std::size_t>(i)];
      if (ci >= 0) normal.shared(i, j) += all(ci, cj);
    }
  }
}

}  // namespace

JointLines::JointLines(const TagTrack& track, std::span<const JointRow> rows, const SharedVector& shared,
                       const JointState::Anchor& anchor) {
  rows_.reserve(rows.size());
  padded_ = (rows.size() + k_lanes - 1) / k_lanes * k_lanes;
  values_ = std::make_unique_for_overwrite<double[]>(n_columns * padded_);
  const At at{anchor.position_m, shared[k_shared_bias] + anchor.delay_m, shared[k_shared_curve],
              shared[k_shared_forward], shared[k_shared_left]};
  Places places;
  Places::Numbers far_m, curve_at, slope;
  std::size_t done = 0;
  const auto finish = [&] {
    places.fill_group();
    Columns to;
    for (std::size_t c = 0; c < n_columns; ++c) to.to[c] = values_.get() + c * padded_ + done;
    (k_wide ? aim_avx2 : aim_plain)(at, places, far_m, to);
    for (std::size_t i = 0; i < (places.n + k_lanes - 1) / k_lanes * k_lanes; ++i) {
      curve_at[i] = range_curve(far_m[i]);
      slope[i] = curve_at[i] > 0 ? 1.0 + at.curve_m / far_m[i] : 1.0;
    }
    (k_wide ? derive_avx2 : derive_plain)(at, places, far_m, curve_at, slope, to);
    done += places.n;
    places.n = 0;
    places.level = true;
  };
  for (const JointRow& row : rows) {
    const double t_s = row.t_s + shared[k_shared_lag];
    const TrackInterval interval = track.interval_at(t_s);
    if (interval.refused != TrackRefusal::none) {
      ++refused_[static_cast<std::size_t>(interval.refused)];
      continue;
    }
    rows_.push_back(&row);
    places.add(interval, t_s, row,
               shared[k_shared_lever] + (row.arm ? shared[k_shared_antennas + *row.arm] : 0.0));
    if (places.n == Places::most) finish();
  }
  if (places.n > 0) finish();
  // What fills the last group weighs nothing, and is a number.
  for (std::size_t c = 0; c < n_columns; ++c)
    std::fill(values_.get() + c * padded_ + done, values_.get() + (c + 1) * padded_, 0.0);
}

JointLine JointLines::line(std::size_t i) const {
  JointLine out;
  out.residual_m = of(residual)[i];
  out.position_variance_m2 = of(variance)[i];
  out.by_anchor << of(x)[i], of(y)[i], of(z)[i], 1.0;
  out.antenna_m << of(antenna_x)[i], of(antenna_y)[i], of(antenna_z)[i];
  out.by_shared[k_shared_bias] = 1.0;
  out.by_shared[k_shared_curve] = of(curve)[i];
  out.by_shared[k_shared_lag] = of(lag)[i];
  out.by_shared[k_shared_lever] = of(lever)[i];
  out.by_shared[k_shared_forward] = of(forward)[i];
  out.by_shared[k_shared_left] = of(left)[i];
  if (const auto& arm = rows_[i]->arm) out.by_shared[k_shared_antennas + *arm] = of(lever)[i];
  return out;
}

std::vector<double> tukey_weights(const JointLines& lines, double variance_m2, double usual_m2,
                                  double cut_off) {
  std::vector<double> out(lines.padded());
  (k_wide ? weigh_avx2 : weigh_plain)(lines, variance_m2, usual_m2, cut_off, out.data());
  out.resize(lines.size());
  return out;
}

std::vector<double> weighted_products(std::span<const double* const> columns,
                                      std::span<const double> weights) {
  const std::size_t n = columns.size();
  std::vector<double> upper(n * (n + 1) / 2), out(n * n);
  (k_wide ? multiply_avx2 : multiply_plain)({columns, weights.data(), weights.size(), upper.data()});
  const double* next = upper.data();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i; j < n; ++j) out[i * n + j] = out[j * n + i] = *next++;
  return out;
}

void add_lines(const JointLines& lines, std::span<const double> weights, double unit, AnchorBlock& block,
               JointNormal& normal) {
  const auto rows = lines.rows();
  std::vector<double> own(lines.padded());
  const std::vector<double> ones(lines.padded(), 1.0);  // the derivatives by delay and bias
  const std::array<const double*, k_summed> columns{
      lines.begin(JointLines::x),     lines.begin(JointLines::y),
      lines.begin(JointLines::z),     ones.data(),
      lines.begin(JointLines::curve), lines.begin(JointLines::lag),
      lines.begin(JointLines::lever), lines.begin(JointLines::forward),
      lines.begin(JointLines::left),  lines.begin(JointLines::residual)};
  std::vector<bool> added(rows.size());
  // Antennas with arms of their own each by themselves, and all others together.
  for (std::size_t first = 0; first < rows.size(); ++first) {
    if (added[first]) continue;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const bool same = rows[i]->arm == rows[first]->arm;
      own[i] = same ? weights[i] * unit : 0.0;
      if (same) added[i] = true;
    }
    const std::vector<double> sums = weighted_products(columns, own);
    add_sums(Eigen::Map<const Summed>(sums.data()), *rows[first], block, normal);
  }
}

}  // namespace anchord
