#include "drivers/sim/flight.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "drivers/sim/receiver_error.hpp"
#include "drivers/sim/tag_reading.hpp"
#include "drivers/sim/wgs84.hpp"

namespace anchord::sim {
namespace {

constexpr std::array k_heights_m{3.5, 9.0, 14.0};
constexpr double k_climb_share = 0.03;                  ///< of the path, before each orbit but the first
const Eigen::Vector3d k_lever_arm_m{0.12, 0.0, -0.28};  ///< GNSS antenna on the mast, tag under the belly
constexpr NetworkId k_tag{0x6e01};

/// Point of a rectangle with rounded corners, at a share of its length, counter-clockwise from the middle of
/// the south side.
Eigen::Vector2d ring_m(const World& world, double clearance_m, double share) {
  const double l = world.length_m, w = world.width_m, arc = std::numbers::pi / 2 * clearance_m;
  const double perimeter_m = 2 * (l + w) + 4 * arc;
  double at_m = std::fmod(share, 1.0) * perimeter_m + l / 2;
  const std::array<std::pair<Eigen::Vector2d, Eigen::Vector2d>, 4> sides{
      {{{0, 0}, {1, 0}}, {{l, 0}, {0, 1}}, {{l, w}, {-1, 0}}, {{0, w}, {0, -1}}}};
  const std::array lengths_m{l, w, l, w};
  for (std::size_t side = 0;; side = (side + 1) % 4) {
    const Eigen::Vector2d along = sides[side].second, outward(along.y(), -along.x());
    if (at_m < lengths_m[side]) return sides[side].first + at_m * along + clearance_m * outward;
    at_m -= lengths_m[side];
    if (at_m < arc) {
      const double angle = at_m / clearance_m;
      return sides[side].first + lengths_m[side] * along +
             clearance_m * (std::cos(angle) * outward + std::sin(angle) * along);
    }
    at_m -= arc;
  }
}

/// The aircraft's nose points along the path, with a slow sway; roll and pitch stay within two degrees.
Eigen::Quaterniond attitude(const World& world, const SimulationOptions& options, double share) {
  constexpr double k_step = 1e-4;
  const Eigen::Vector3d ahead = orbit_m(world, options, std::min(share + k_step, 1.0)) -
                                orbit_m(world, options, std::max(share - k_step, 0.0));
  const double time_s = share * options.duration_s;
  const double yaw = std::atan2(ahead.y(), ahead.x()) + 0.2 * std::sin(0.31 * time_s);
  const double pitch = 0.03 * std::sin(0.83 * time_s), roll = 0.03 * std::cos(0.57 * time_s);
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

std::vector<Fix> simulate_fixes(const World& world, const SimulationOptions& options, Random& random) {
  std::vector<Fix> fixes;
  const double step_s = 1.0 / options.fix_rate_hz;
  ReceiverError error(step_s, random);
  const double float_from = 0.3 + 0.4 * random.uniform(), float_to = float_from + options.float_share;
  const auto count = static_cast<std::int64_t>(options.duration_s * options.fix_rate_hz);
  for (std::int64_t i = 0; i <= count; ++i) {
    const double time_s = static_cast<double>(i) * step_s, share = std::min(time_s / options.duration_s, 1.0);
    const bool is_float = share >= float_from && share < float_to;
    const Eigen::Vector3d sigma_m =
        is_float ? Eigen::Vector3d(0.25, 0.25, 0.45) : Eigen::Vector3d(0.010, 0.010, 0.018);
    Fix fix;
    fix.time = UtcTime{options.start.ns + static_cast<std::int64_t>(std::llround(time_s * 1e6)) * 1000};
    fix.seq = static_cast<std::uint64_t>(i);
    fix.position = wgs84_from_enu(world.origin, orbit_m(world, options, share) + error.next(sigma_m));
    fix.fix = is_float ? FixClass::rtk_float : FixClass::rtk_fixed;
    fix.covariance_m2 = Eigen::Matrix3d(sigma_m.cwiseProduct(sigma_m).asDiagonal());
    fix.enu_from_body = attitude(world, options, share);
    fix.correction_age_s = is_float ? 4.0 : 0.8;
    fix.satellites = is_float ? 11 : 19;
    fixes.push_back(fix);
  }
  return fixes;
}

std::vector<Range> simulate_ranges(const World& world, const SimulationOptions& options, Random& random) {
  Random impulse_random(options.seed ^ 0xc2b2ae3d27d4eb4fU);  // leaves distances as they are without
  std::vector<double> bias_m;
  for (std::size_t i = 0; i < world.anchors.size(); ++i)
    bias_m.push_back(options.radio.anchor_bias_sigma_m * random.normal());
  std::vector<Range> ranges;
  const auto count = static_cast<std::int64_t>(options.duration_s * options.range_rate_hz);
  for (std::int64_t i = 0; i < count; ++i) {
    const double time_s = (static_cast<double>(i) + 0.1 * random.uniform()) / options.range_rate_hz;
    const double share = std::min(time_s / options.duration_s, 1.0);
    const std::size_t index = static_cast<std::size_t>(i) % world.anchors.size();
    const WorldAnchor& anchor = world.anchors[index];
    const Eigen::Vector3d tag_m =
        orbit_m(world, options, share) + attitude(world, options, share) * k_lever_arm_m;
    const auto exchange = simulate_exchange(world, options.radio, tag_m, anchor, bias_m[index], random);
    if (!exchange) continue;
    Range range;
    range.time = UtcTime{options.start.ns +
                         static_cast<std::int64_t>(std::llround((time_s + options.lag_s) * 1e6)) * 1000};
    range.tag = k_tag;
    range.anchor = anchor.id;
    range.seq = static_cast<std::uint64_t>(i);
    range.distance_m =
        std::round(exchange->distance_m * 1000.0) / 1000.0;  // the device answers whole millimetres
    range.rss_dbm = std::round(exchange->rss_dbm * 100.0) / 100.0;
    range.truth = RangeTruth{exchange->truth_m, exchange->line_of_sight};
    if (options.impulse) read_as_tag(range, *exchange, *options.impulse, impulse_random);
    ranges.push_back(std::move(range));
  }
  return ranges;
}

}  // namespace

Eigen::Vector3d orbit_m(const World& world, const SimulationOptions& options, double share) {
  const double orbit_share = (1.0 - k_climb_share * (k_heights_m.size() - 1)) / k_heights_m.size();
  double left = share;
  for (std::size_t level = 0; level < k_heights_m.size(); ++level) {
    const bool last = level + 1 == k_heights_m.size();
    if (left < orbit_share || last) {
      const Eigen::Vector2d at_m =
          ring_m(world, options.clearance_m, std::clamp(left / orbit_share, 0.0, 1.0));
      return {at_m.x(), at_m.y(), k_heights_m[level]};
    }
    left -= orbit_share;
    if (left < k_climb_share) {
      const Eigen::Vector2d at_m = ring_m(world, options.clearance_m, 0);
      const double up = left / k_climb_share;
      return {at_m.x(), at_m.y(), k_heights_m[level] + up * (k_heights_m[level + 1] - k_heights_m[level])};
    }
    left -= k_climb_share;
  }
  return {0, 0, 0};  // not reached: the last level returns
}

Result<SimulatedFlight> simulate_flight(const World& world, const SimulationOptions& options) {
  const auto positive = [](double value, double limit) {
    return value > 0 && value <= limit;
  };  // false for NaN
  if (!positive(options.duration_s, 14'400))
    return make_error(Errc::invalid_argument, "duration must be in 0..14400 s");
  if (!positive(options.range_rate_hz, 10'000))
    return make_error(Errc::invalid_argument, "range rate must be in 0..10000 Hz");
  if (!positive(options.fix_rate_hz, 1'000))
    return make_error(Errc::invalid_argument, "fix rate must be in 0..1000 Hz");
  if (!positive(options.clearance_m, 1'000))
    return make_error(Errc::invalid_argument, "clearance must be in 0..1000 m");
  if (world.anchors.empty()) return make_error(Errc::invalid_argument, "the world has no anchors");
  SimulatedFlight flight;
  Mission& mission = flight.data.mission;
  mission.name = "simulated flight, seed " + std::to_string(options.seed);
  mission.kit = "simulated";
  mission.radio = "DW1000 channel 2";
  mission.frame = TrackFrame::wgs84;
  mission.point = TrackPoint::gnss_antenna;
  mission.tags = {{k_tag, 0, k_lever_arm_m}};
  mission.created = options.start;
  // Two generators, so that another fix rate leaves the ranges as they were.
  Random fix_random(options.seed), range_random(options.seed ^ 0x9e3779b97f4a7c15u);
  flight.data.fixes = simulate_fixes(world, options, fix_random);
  flight.data.ranges = simulate_ranges(world, options, range_random);
  for (const WorldAnchor& anchor : world.anchors) {
    flight.data.anchor_names[anchor.id] = to_string(anchor.id);
    flight.truth_enu_m[anchor.id] = anchor.enu_m;
    flight.truth_wgs84[anchor.id] = wgs84_from_enu(world.origin, anchor.enu_m);
  }
  return flight;
}

}  // namespace anchord::sim
