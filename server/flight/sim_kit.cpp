#include "server/flight/sim_kit.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "drivers/sim/wgs84.hpp"

namespace anchord::flight {
namespace {

constexpr int k_ranges_a_step = 3;  // 30 Hz over all anchors in turn, as the tag does
constexpr double k_lag_s = 0.02;    // range stamps are late against the receiver's
constexpr NetworkId k_tag{0x6e01};
constexpr UtcTime k_start = UtcTime::from_us(1'777'888'800'000'000);  // 2026-05-04T10:00:00Z
const Eigen::Vector3d k_lever_arm_m{0.12, 0.0, -0.28};
const Eigen::Vector3d k_sigma_m{0.010, 0.010, 0.018};

}  // namespace

SimKit::SimKit(const sim::World& world, const sim::RadioOptions& radio, std::uint64_t seed,
               std::optional<UtcTime> start)
    : world_(world),
      radio_(radio),
      start_(start.value_or(k_start)),
      fix_random_(seed),
      range_random_(seed ^ 0x9e3779b97f4a7c15U),
      error_(k_step_s, fix_random_) {
  for (std::size_t i = 0; i < world.anchors.size(); ++i) {
    bias_m_.push_back(radio.anchor_bias_sigma_m * range_random_.normal());
  }
}

UtcTime SimKit::time_at(double seconds) const {
  return {start_.ns + static_cast<std::int64_t>(std::llround(seconds * 1e6)) * 1000};
}

Mission SimKit::mission() const {
  Mission m;
  m.name = "simulated mission";
  m.kit = "simulated";
  m.radio = "DW1000 channel 2";
  m.tags = {{k_tag, 0, k_lever_arm_m}};
  m.created = start_;
  return m;
}

Eigen::Quaterniond SimKit::attitude(double heading_rad, double time_s) const {
  // Yaw of the axes forward, left, up counts from east, anticlockwise.
  return Eigen::AngleAxisd(std::numbers::pi / 2 - heading_rad, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(0.03 * std::sin(0.83 * time_s), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(0.03 * std::cos(0.57 * time_s), Eigen::Vector3d::UnitX());
}

SimKit::Measured SimKit::advance(sim::Vehicle& vehicle) {
  const Eigen::Vector3d before_m = vehicle.position_m();
  vehicle.advance(k_step_s);
  return observe(before_m, vehicle);
}

SimKit::Measured SimKit::observe(const Eigen::Vector3d& before_m, const sim::Vehicle& vehicle) {
  Measured out;
  const double before_s = now_s();
  ++n_;
  const Eigen::Vector3d after_m = vehicle.position_m();
  for (int i = 0; i < k_ranges_a_step; ++i) {
    const double share = (i + 0.1 * range_random_.uniform()) / k_ranges_a_step;
    const double time_s = before_s + share * k_step_s;
    const std::size_t index = n_ranges_ % world_.anchors.size();
    const auto& anchor = world_.anchors[index];
    const Eigen::Vector3d antenna_m = before_m + share * (after_m - before_m);
    const sim::Terminal tag{antenna_m + attitude(vehicle.heading_rad(), time_s) * k_lever_arm_m,
                            vehicle.heading_rad(), 0};
    const auto exchange = sim::simulate_exchange(world_, radio_, tag,
                                                 {anchor.enu_m, std::nullopt, bias_m_[index]}, range_random_);
    ++n_ranges_;
    if (!exchange || tag_silent_) continue;
    Range range;
    range.time = time_at(time_s + k_lag_s);
    range.tag = k_tag;
    range.anchor = anchor.id;
    range.seq = n_ranges_;
    range.distance_m = std::round(exchange->distance_m * 1000) / 1000;
    range.rss_dbm = std::round(exchange->rss_dbm * 100) / 100;
    range.heading_deg = vehicle.heading_rad() * 180 / std::numbers::pi;
    range.truth = RangeTruth{exchange->truth_m, exchange->line_of_sight};
    out.ranges.push_back(std::move(range));
  }
  const Eigen::Vector3d error_m = error_.next(k_sigma_m);
  Fix fix;
  fix.time = time_at(now_s());
  fix.seq = n_;
  fix.position = sim::wgs84_from_enu(world_.origin, after_m + error_m);
  fix.fix = fix_lost_ ? FixClass::none : FixClass::rtk_fixed;
  fix.covariance_m2 = Eigen::Matrix3d(k_sigma_m.cwiseProduct(k_sigma_m).asDiagonal());
  fix.enu_from_body = attitude(vehicle.heading_rad(), now_s());
  fix.correction_age_s = 0.8;
  fix.satellites = 19;
  out.fixes.push_back(std::move(fix));
  return out;
}

}  // namespace anchord::flight
