#include "core/localize/joint_lines.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/localize/lanes.hpp"

namespace anchord {
namespace {

using namespace lanes;

/// One row, and where in the track it is.
struct Placed {
  const JointRow* row;
  TrackInterval in;
  double t_s, arm_up_m;
};

constexpr std::size_t k_most_rows = 64;
using Numbers = std::array<double, k_most_rows>;

/// Some rows on their way: where the antenna was, and what its place depends on.
struct Places {
  Numbers distance_m, up_m, x_m, y_m, z_m, vx_mps, vy_mps, vz_mps, xx_m2, xy_m2, xz_m2, yy_m2, yz_m2, zz_m2;
  Numbers ux, uy, uz, fx, fy, fz, lx, ly, lz;  ///< axes of the body, where it is not level
  // Of rows with attitude: arm in the body, and the poses before and after with their shares in the attitude.
  Numbers ax_m, ay_m, az_m, during_s, px_m, py_m, pz_m, by_before, by_later, bx, by, bz, bw, qx, qy, qz, qw;
  std::size_t n{0};
  bool level{true};  ///< all of them: no attitude is known, and no axes are set

  /// turned: all rows have attitude
  ANCHORD_INLINE void add(const Placed& placed, bool turned) {
    const TrackPose &before = *placed.in.before, &later = *placed.in.later;
    const JointRow& row = *placed.row;
    distance_m[n] = row.distance_m;
    up_m[n] = placed.arm_up_m;
    const double interval_s = later.t_s - before.t_s;
    const double share = interval_s > 0 ? (placed.t_s - before.t_s) / interval_s : 0.0, rest = 1.0 - share;
    // Column by column: xx yx zx xy, yy zy xz yz, zz.
    const double *const a = before.covariance_m2.data(), *const b = later.covariance_m2.data();
    const Four first = rest * load(a) + share * load(b), second = rest * load(a + 4) + share * load(b + 4);
    const double missed_m2 = placed.in.missed_m * placed.in.missed_m;
    xx_m2[n] = first[0] + missed_m2;
    yy_m2[n] = second[0] + missed_m2;
    zz_m2[n] = rest * a[8] + share * b[8] + missed_m2;
    xy_m2[n] = first[3] + first[1];
    xz_m2[n] = second[2] + first[2];
    yz_m2[n] = second[3] + second[1];
    if (!turned && before.attitude && later.attitude) {
      turn(interpolate(before, later, placed.t_s, row.lever_arm_body_m));
    } else {
      const double *const p = before.position_m.data(), *const q = later.position_m.data();
      const double per_s = interval_s > 0 ? 1.0 / interval_s : 0.0;
      x_m[n] = rest * p[0] + share * q[0];
      y_m[n] = rest * p[1] + share * q[1];
      z_m[n] = rest * p[2] + share * q[2];
      if (turned) {
        keep_attitudes(before, later, row, share, interval_s);
      } else {
        vx_mps[n] = (q[0] - p[0]) * per_s;
        vy_mps[n] = (q[1] - p[1]) * per_s;
        vz_mps[n] = (q[2] - p[2]) * per_s;
        z_m[n] += row.lever_arm_body_m.data()[2];
        if (!level) set_axes({0, 0, 1}, {0, 0, 0}, {0, 0, 0});
      }
    }
    ++n;
  }
  /// Axes of the body and its arm, of rows that all have attitude: what interpolate() does with each.
  ANCHORD_INLINE void turn_all() {
    level = false;
    const Four one = Four{} + 1.0, none{};
    for (std::size_t i = 0; i < n; i += k_lanes) {
      const Four s = load(&by_before[i]), t = load(&by_later[i]);
      const Turned before{load(&bx[i]), load(&by[i]), load(&bz[i]), load(&bw[i])};
      const Turned later{load(&qx[i]), load(&qy[i]), load(&qz[i]), load(&qw[i])};
      const Turned now{s * before.x + t * later.x, s * before.y + t * later.y, s * before.z + t * later.z,
                       s * before.w + t * later.w};
      const auto put = [i](const Three& axis, Numbers& x, Numbers& y, Numbers& z) {
        store(&x[i], axis[0]);
        store(&y[i], axis[1]);
        store(&z[i], axis[2]);
      };
      put(now.turn({none, none, one}), ux, uy, uz);
      put(now.turn({one, none, none}), fx, fy, fz);
      put(now.turn({none, one, none}), lx, ly, lz);
      const Three arm{load(&ax_m[i]), load(&ay_m[i]), load(&az_m[i])};
      const Three at = now.turn(arm), from = before.turn(arm), to = later.turn(arm);
      const Four during = load(&during_s[i]);
      // The speeds are the places of the poses until here.
      const std::array<double*, 3> place_m{&x_m[i], &y_m[i], &z_m[i]},
          speed{&vx_mps[i], &vy_mps[i], &vz_mps[i]};
      const std::array<double*, 3> first_m{&px_m[i], &py_m[i], &pz_m[i]};
      for (std::size_t k = 0; k < 3; ++k) {
        store(place_m[k], load(place_m[k]) + at[k]);
        const Four way = load(speed[k]) + to[k] - load(first_m[k]) - from[k];
        store(speed[k], during > 0.0 ? way / (during > 0.0 ? during : one) : none);
      }
    }
  }
  /// The last ones again, up to a whole group: they are not read.
  void fill_group() {
    for (std::size_t to = n; n > 0 && to % k_lanes != 0; ++to)
      for (Numbers* numbers :
           {&distance_m, &up_m,  &x_m, &y_m, &z_m, &vx_mps, &vy_mps, &vz_mps, &xx_m2, &xy_m2, &xz_m2, &yy_m2,
            &yz_m2,      &zz_m2, &ux,  &uy,  &uz,  &fx,     &fy,     &fz,     &lx,    &ly,    &lz})
        (*numbers)[to] = (*numbers)[n - 1];
  }
  void fill_attitudes() {
    for (std::size_t to = n; n > 0 && to % k_lanes != 0; ++to)
      for (Numbers* numbers : {&x_m,  &y_m,      &z_m,  &vx_mps, &vy_mps, &vz_mps,    &ax_m,     &ay_m,
                               &az_m, &during_s, &px_m, &py_m,   &pz_m,   &by_before, &by_later, &bx,
                               &by,   &bz,       &bw,   &qx,     &qy,     &qz,        &qw})
        (*numbers)[to] = (*numbers)[n - 1];
  }

 private:
  using Three = std::array<Four, 3>;
  static ANCHORD_INLINE Three cross(const Three& a, const Three& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }
  /// Four quaternions, which turn four vectors as Eigen's do.
  struct Turned {
    Four x, y, z, w;
    ANCHORD_INLINE Three turn(const Three& v) const {
      const Three axis{x, y, z};
      Three twice = cross(axis, v);
      for (Four& one : twice) one += one;
      const Three more = cross(axis, twice);
      return {v[0] + w * twice[0] + more[0], v[1] + w * twice[1] + more[1], v[2] + w * twice[2] + more[2]};
    }
  };
  ANCHORD_INLINE void keep_attitudes(const TrackPose& before, const TrackPose& later, const JointRow& row,
                                     double share, double interval_s) {
    const double *const b = before.attitude->coeffs().data(), *const q = later.attitude->coeffs().data();
    const double *const p = before.position_m.data(), *const p_later = later.position_m.data();
    px_m[n] = p[0];
    py_m[n] = p[1];
    pz_m[n] = p[2];
    vx_mps[n] = p_later[0];
    vy_mps[n] = p_later[1];
    vz_mps[n] = p_later[2];
    during_s[n] = interval_s;
    const double* const arm_m = row.lever_arm_body_m.data();
    ax_m[n] = arm_m[0];
    ay_m[n] = arm_m[1];
    az_m[n] = arm_m[2];
    bx[n] = b[0];
    by[n] = b[1];
    bz[n] = b[2];
    bw[n] = b[3];
    qx[n] = q[0];
    qy[n] = q[1];
    qz[n] = q[2];
    qw[n] = q[3];
    // Spherical linear interpolation, as Eigen has it.
    const double cosine = before.attitude->dot(*later.attitude), size = std::abs(cosine);
    by_before[n] = 1.0 - share;
    by_later[n] = share;
    if (size < 1.0 - std::numeric_limits<double>::epsilon()) {
      const double angle = std::acos(size), sine = std::sin(angle);
      by_before[n] = std::sin((1.0 - share) * angle) / sine;
      by_later[n] = std::sin(share * angle) / sine;
    }
    if (cosine < 0) by_later[n] = -by_later[n];
  }
  void turn(const TagPoint& point) {
    if (std::exchange(level, false))
      for (std::size_t end = std::exchange(n, 0); n < end; ++n) set_axes({0, 0, 1}, {0, 0, 0}, {0, 0, 0});
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
ANCHORD_INLINE void aim(const At& at, Places& p, Numbers& far_m, const Columns& out) {
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
ANCHORD_INLINE void derive(const At& at, const Places& p, const Numbers& far_m, const Numbers& curve,
                           const Numbers& slope, const Columns& out) {
  const Four nothing{};
  for (std::size_t i = 0; i < p.n; i += k_lanes) {
    const Four x = load(&p.x_m[i]), y = load(&p.y_m[i]), z = load(&p.z_m[i]), s = load(&slope[i]);
    const auto along = [&](const Numbers& a, const Numbers& b, const Numbers& c) {
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
ANCHORD_INLINE void multiply_by(const double* column, const double* const* columns, const Products& p,
                                double* out) {
  std::array<Four, many> sums{};
  for (std::size_t i = 0; i < p.padded; i += k_lanes) {
    const Four weighed = load(p.weights + i) * load(column + i);
    for (std::size_t j = 0; j < many; ++j) sums[j] += weighed * load(columns[j] + i);
  }
  for (std::size_t j = 0; j < many; ++j) out[j] = (sums[j][0] + sums[j][1]) + (sums[j][2] + sums[j][3]);
}
template <std::size_t... many>
ANCHORD_INLINE void multiply_by_first(std::size_t n, const double* column, const double* const* columns,
                                      const Products& p, double* out, std::index_sequence<many...>) {
  (void)((n == many + 1 && (multiply_by<many + 1>(column, columns, p, out), true)) || ...);
}
ANCHORD_INLINE void multiply(const Products& p) {
  double* out = p.out;
  for (std::size_t i = 0; i < p.columns.size(); ++i)
    for (std::size_t j = i; j < p.columns.size(); j += k_most_sums) {
      const std::size_t n = std::min(k_most_sums, p.columns.size() - j);
      multiply_by_first(n, p.columns[i], &p.columns[j], p, out, std::make_index_sequence<k_most_sums>());
      out += n;
    }
}
ANCHORD_INLINE void weigh(const JointLines& lines, double variance_m2, double usual_m2, double cut_off,
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

ANCHORD_INLINE void place(std::span<const Placed> placed, Places& to) {
  const bool turned = !placed.empty() && std::ranges::all_of(placed, [](const Placed& one) {
    return one.in.before->attitude && one.in.later->attitude;
  });
  for (const Placed& one : placed) to.add(one, turned);
  if (!turned) return;
  to.fill_attitudes();
  to.turn_all();
}
/// The two poses of an interval stand side by side; they are looked at when the group is whole.
void fetch(const TrackInterval& in) {
  const char* const from = reinterpret_cast<const char*>(in.before);
  for (std::size_t at = 0; at < 2 * sizeof(TrackPose); at += 64) __builtin_prefetch(from + at);
}

void place_plain(std::span<const Placed> placed, Places& to) { place(placed, to); }
void aim_plain(const At& at, Places& p, Numbers& far_m, const Columns& out) { aim(at, p, far_m, out); }
void derive_plain(const At& at, const Places& p, const Numbers& far_m, const Numbers& curve,
                  const Numbers& slope, const Columns& out) {
  derive(at, p, far_m, curve, slope, out);
}
void multiply_plain(const Products& products) { multiply(products); }
void weigh_plain(const JointLines& lines, double variance_m2, double usual_m2, double cut_off, double* to) {
  weigh(lines, variance_m2, usual_m2, cut_off, to);
}
#if defined(__x86_64__)
__attribute__((target("avx2"))) void place_avx2(std::span<const Placed> placed, Places& to) {
  place(placed, to);
}
__attribute__((target("avx2"))) void aim_avx2(const At& at, Places& p, Numbers& far_m, const Columns& out) {
  aim(at, p, far_m, out);
}
__attribute__((target("avx2"))) void derive_avx2(const At& at, const Places& p, const Numbers& far_m,
                                                 const Numbers& curve, const Numbers& slope,
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
constexpr auto place_avx2 = place_plain;
constexpr auto aim_avx2 = aim_plain;
constexpr auto derive_avx2 = derive_plain;
constexpr auto multiply_avx2 = multiply_plain;
constexpr auto weigh_avx2 = weigh_plain;
#endif

constexpr int k_summed = 10;
using Summed = Eigen::Matrix<double, k_summed, k_summed>;

/// Sums of the products of x, y, z, delay and bias, curve, lag, lever, forward, left and residual.
Summed summed(const JointLines& lines, std::span<const double> ones, std::span<const double> weights) {
  using L = JointLines;
  constexpr std::size_t k_turned = 7, k_turned_end = 9;
  const std::array<const double*, k_summed> all{
      lines.begin(L::x),     lines.begin(L::y),       lines.begin(L::z),     ones.data(),
      lines.begin(L::curve), lines.begin(L::lag),     lines.begin(L::lever), lines.begin(L::forward),
      lines.begin(L::left),  lines.begin(L::residual)};
  if (!lines.level()) return Eigen::Map<const Summed>(weighted_products(all, weights).data());
  // What is nothing multiplies to nothing.
  std::array<const double*, k_summed + k_turned - k_turned_end> columns;
  const auto rest = std::copy_n(all.begin(), k_turned, columns.begin());
  std::copy(all.begin() + k_turned_end, all.end(), rest);
  const std::vector<double> products = weighted_products(columns, weights);
  Summed out = Summed::Zero();
  const auto place = [](std::size_t i) { return static_cast<Eigen::Index>(i < k_turned ? i : i + 2); };
  for (std::size_t i = 0; i < columns.size(); ++i)
    for (std::size_t j = 0; j < columns.size(); ++j)
      out(place(i), place(j)) = products[i * columns.size() + j];
  return out;
}

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
  Numbers far_m, curve_at, slope;
  std::array<Placed, k_most_rows> placed;
  std::size_t done = 0, n_placed = 0;
  const auto finish = [&] {
    (k_wide ? place_avx2 : place_plain)({placed.data(), n_placed}, places);
    n_placed = 0;
    level_ = level_ && places.level;
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
  const double lag_s = shared[k_shared_lag], lever_m = shared[k_shared_lever];
  double* const stamps_s = values_.get() + stamp * padded_;
  for (const JointRow& row : rows) {
    Placed& next = placed[n_placed];
    next.row = &row;
    next.t_s = row.t_s + lag_s;
    next.in = track.interval_at(next.t_s);
    if (next.in.refused != TrackRefusal::none) {
      ++refused_[static_cast<std::size_t>(next.in.refused)];
      continue;
    }
    fetch(next.in);
    next.arm_up_m = lever_m + (row.arm ? shared[k_shared_antennas + *row.arm] : 0.0);
    stamps_s[rows_.size()] = row.t_s;
    rows_.push_back(&row);
    const JointRow& first = *rows_.front();
    one_arm_ = one_arm_ && row.arm == first.arm;
    one_antenna_ = one_antenna_ && row.tag == first.tag && row.antenna == first.antenna;
    without_models_ = without_models_ && row.error_model == nullptr;
    if (++n_placed == k_most_rows) finish();
  }
  if (n_placed > 0) finish();
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
  if (rows.empty()) return;
  std::vector<double> own(lines.padded());
  const std::vector<double> ones(lines.padded(), 1.0);  // the derivatives by delay and bias
  if (lines.one_arm()) {
    std::ranges::transform(weights, own.begin(), [unit](double weight) { return weight * unit; });
    add_sums(summed(lines, ones, own), *rows.front(), block, normal);
    return;
  }
  std::vector<bool> added(rows.size());
  // Antennas with arms of their own each by themselves, and all others together.
  for (std::size_t first = 0; first < rows.size(); ++first) {
    if (added[first]) continue;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const bool same = rows[i]->arm == rows[first]->arm;
      own[i] = same ? weights[i] * unit : 0.0;
      if (same) added[i] = true;
    }
    add_sums(summed(lines, ones, own), *rows[first], block, normal);
  }
}

}  // namespace anchord
