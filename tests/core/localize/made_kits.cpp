#include "tests/core/localize/made_kits.hpp"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>

#include "core/localize/joint_model.hpp"

namespace anchord::testing {
namespace {

constexpr double k_wander_m = 0.03;  // of the bias, from flight to flight
constexpr double k_slow_m = 0.05;    // errors that stay alike for seconds
constexpr double k_slow_s = 5.0;
constexpr double k_harmonic_m = 0.03;  // 0.07 m together: anchors in a room differed by -0.07 to 0.11 m

double normal(Random& random, double sigma) { return std::normal_distribution<double>(0, sigma)(random); }
double between(Random& random, double a, double b) {
  return std::uniform_real_distribution<double>(a, b)(random);
}

/// The real harmonics of second degree, mean square 1 over the sphere.
Eigen::Matrix<double, 5, 1> harmonics(const Eigen::Vector3d& way) {
  const Eigen::Vector3d u = way.normalized();
  Eigen::Matrix<double, 5, 1> h;
  h << u.x() * u.y(), u.y() * u.z(), u.x() * u.z(), 0.5 * (u.x() * u.x() - u.y() * u.y()),
      (3 * u.z() * u.z() - 1) / (2 * std::sqrt(3.0));
  return std::sqrt(15.0) * h;
}

struct Way {
  Eigen::Vector3d at_m;
  double course_rad{};
};

/// A box, and what its faces delay: east, west, north, south, roof.
struct Building {
  Eigen::Vector3d half_m;  ///< of the roof the height
  std::array<double, 5> late_m{};

  static Building draw(const Eigen::Vector3d& half_m, double share, Random& random) {
    Building building{half_m};
    for (double& m : building.late_m) m = between(random, 0, 1) < share ? between(random, 0.1, 0.8) : 0.0;
    return building;
  }
  /// Of the face that a ray outwards leaves through first.
  double late(const Eigen::Vector3d& from_m, const Eigen::Vector3d& way) const {
    double nearest = 1.0, m = 0;
    const auto ask = [&](double wall_m, int axis, std::size_t face) {
      const double at = (wall_m - from_m[axis]) / way[axis];
      if (!(at > 0) || at >= nearest) return;
      nearest = at;
      m = late_m[face];
    };
    for (int axis = 0; axis < 2; ++axis)
      ask(std::copysign(half_m[axis], way[axis]), axis, 2 * static_cast<std::size_t>(axis) + (way[axis] < 0));
    if (way.z() > 0) ask(half_m.z(), 2, 4);
    return m;
  }
};

/// Round the walls, up and down.
struct Course {
  double half_x_m, half_y_m, middle_m, swing_m, rate_radps, climb_radps, phase_rad;
  Way at(double t_s) const {
    const double a = rate_radps * t_s + phase_rad;
    return {
        {half_x_m * std::cos(a), half_y_m * std::sin(a), middle_m + swing_m * std::sin(climb_radps * t_s)},
        std::atan2(half_y_m * std::cos(a), -half_x_m * std::sin(a))};
  }
};

void add_track(FlightData& flight, const Course& course, double duration_s, Random& random) {
  for (double t_s = 0; t_s < duration_s; t_s += 0.2) {
    const Way way = course.at(t_s);
    Fix fix;
    fix.time = UtcTime::from_seconds(t_s);
    fix.frame = TrackFrame::local;
    fix.fix = FixClass::rtk_fixed;
    fix.local_m =
        way.at_m + Eigen::Vector3d(normal(random, 0.01), normal(random, 0.01), normal(random, 0.015));
    fix.enu_from_body = Eigen::Quaterniond(Eigen::AngleAxisd(way.course_rad, Eigen::Vector3d::UnitZ()));
    flight.fixes.push_back(fix);
  }
}

}  // namespace

const char* word(Spoilage spoilage) {
  switch (spoilage) {
    case Spoilage::none:
      return "none";
    case Spoilage::scattered:
      return "scattered";
    case Spoilage::bursts:
      return "bursts";
    case Spoilage::one_sided:
      return "one side";
    case Spoilage::one_anchor:
      return "one anchor";
    case Spoilage::far_off:
      return "0 to 20 m";
    case Spoilage::late_side:
      return "late side";
    case Spoilage::walls:
      return "walls";
  }
  return "";
}

MadeKit draw_kit(double bias_m, Random& random) {
  MadeKit kit;
  kit.bias_m = bias_m;
  kit.curve_m = normal(random, 0.03);
  kit.lag_s = normal(random, 0.1);
  kit.lever_up_m = normal(random, 0.05);
  kit.unit_delay_m = 0.04;
  for (double& m : kit.pattern_m) m = normal(random, k_harmonic_m);
  return kit;
}

FlightOptions KitFlight::options() const {
  FlightOptions options;
  options.starts = truth_m;
  return options;
}

KitFlight fly(const MadeKit& kit, const std::string& name, Random& random, Spoilage spoilage, double share) {
  KitFlight made;
  FlightData& flight = made.flight;
  flight.mission.name = name;
  flight.mission.kit = "made";
  flight.mission.frame = TrackFrame::local;
  flight.mission.point = TrackPoint::body;
  flight.mission.tags = {{NetworkId{0x6e01}, 0, {0, 0, 0}}};
  const double wall_x_m = between(random, 6, 20), wall_y_m = between(random, 5, 12);
  const double off_m = between(random, 3, 8), top_m = between(random, 6, 14);
  const double duration_s = between(random, 60, 120);
  const Course course{wall_x_m + off_m,          wall_y_m + off_m,          0.5 * top_m + 1.5,    0.5 * top_m,
                      between(random, 0.1, 0.2), between(random, 0.2, 0.4), between(random, 0, 6)};
  add_track(flight, course, duration_s, random);
  const double bias_m = kit.bias_m + normal(random, k_wander_m);
  const double blocked_from_rad = between(random, 0, 2 * std::numbers::pi);
  const double noise_m = between(random, 0.02, 0.06);
  const int n_anchors = static_cast<int>(between(random, 4, 7));
  const Building building =
      spoilage == Spoilage::walls ? Building::draw({wall_x_m, wall_y_m, top_m}, share, random) : Building{};
  for (int a = 0; a < n_anchors; ++a) {
    const NetworkId id{static_cast<std::uint32_t>(0x6000 + a)};
    flight.anchor_names[id] = to_string(id);
    const Eigen::Vector3d at(between(random, -wall_x_m, wall_x_m), between(random, -wall_y_m, wall_y_m),
                             between(random, 0.5, top_m));
    made.truth_m[id] = at;
    const double delay_m = normal(random, kit.unit_delay_m);
    double slow_m = normal(random, k_slow_m), burst_until_s = -1;
    for (double t_s = 1.0 + 0.03 * a; t_s < duration_s - 1.5; t_s += 0.4) {
      const Way way = course.at(t_s + kit.lag_s);
      const Eigen::Matrix3d turn =
          Eigen::AngleAxisd(way.course_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      const Eigen::Vector3d antenna = way.at_m + Eigen::Vector3d(0, 0, kit.lever_up_m);
      const Eigen::Vector3d ray = at - antenna;
      const double keep = std::exp(-0.4 / k_slow_s);
      slow_m = keep * slow_m + normal(random, k_slow_m * std::sqrt(1 - keep * keep));
      Range range;
      range.time = UtcTime::from_seconds(t_s);
      range.tag = NetworkId{0x6e01};
      range.anchor = id;
      range.distance_m = ray.norm() + bias_m + delay_m + kit.curve_m * range_curve(ray.norm()) +
                         kit.pattern_m.dot(harmonics(turn.transpose() * ray)) + slow_m +
                         normal(random, noise_m);
      bool late = false;
      switch (spoilage) {
        case Spoilage::none:
          break;
        case Spoilage::scattered:
        case Spoilage::far_off:
          late = between(random, 0, 1) < share;
          break;
        case Spoilage::bursts:
          if (t_s > burst_until_s && between(random, 0, 1) < share * 0.4 / 8.0 / std::max(1 - share, 0.1))
            burst_until_s = t_s + 8.0;
          late = t_s < burst_until_s;
          break;
        case Spoilage::one_sided:
        case Spoilage::late_side: {
          const double from =
              std::remainder(std::atan2(ray.y(), ray.x()) - blocked_from_rad, 2 * std::numbers::pi);
          late = std::abs(from) < share * std::numbers::pi;
          break;
        }
        case Spoilage::one_anchor:
          late = a == 0;
          break;
        case Spoilage::walls:
          range.distance_m += building.late(at, -ray);
          break;
      }
      if (late && spoilage == Spoilage::far_off)
        range.distance_m += between(random, 0, 20);
      else if (late && spoilage == Spoilage::late_side)
        range.distance_m += 0.5;
      else if (late)
        range.distance_m += 0.3 + std::exponential_distribution<double>(1 / 0.5)(random);
      flight.ranges.push_back(range);
    }
  }
  return made;
}

}  // namespace anchord::testing
