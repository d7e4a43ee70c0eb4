#include "tests/core/localize/flight_support.hpp"

#include "core/geo/enu.hpp"

namespace anchord::testing {

FlightData make_flight(const MadeFlight& m) {
  std::mt19937_64 random(m.seed);
  std::normal_distribution<double> noise(0, 1);
  std::uniform_real_distribution<double> uniform(0, 1);
  FlightData flight;
  flight.mission.name = "made_" + std::to_string(m.seed);
  flight.mission.kit = "made";
  flight.mission.frame = m.frame;
  flight.mission.point = TrackPoint::body;
  flight.mission.tags = {{NetworkId{0x6e01}, 0, {0, 0, 0}}};
  const EnuFrame frame(m.origin);
  for (int i = 0; i < static_cast<int>(m.duration_s * 10); ++i) {
    const double t_s = 0.1 * i;
    Fix fix;
    fix.time = UtcTime::from_seconds(t_s);
    fix.frame = m.frame;
    const Eigen::Vector3d at =
        path(m, t_s) + 0.005 * Eigen::Vector3d(noise(random), noise(random), noise(random));
    if (m.frame == TrackFrame::local) {
      fix.local_m = at;
    } else {
      fix.position = frame.wgs84_from_enu({at});
    }
    fix.fix = FixClass::rtk_fixed;
    fix.enu_from_body =
        Eigen::Quaterniond(Eigen::AngleAxisd(m.turn_rate_radps * t_s, Eigen::Vector3d::UnitZ()));
    flight.fixes.push_back(fix);
  }
  for (std::size_t a = 0; a < m.anchors.size(); ++a) {
    const NetworkId id{static_cast<std::uint32_t>(0x6000 + a)};
    flight.anchor_names[id] = to_string(id);
    for (double t_s = 0.5 + 0.01 * static_cast<double>(a); t_s < m.duration_s - 1.0; t_s += 0.12) {
      Range range;
      range.time = UtcTime::from_seconds(t_s);
      range.tag = NetworkId{0x6e01};
      range.anchor = id;
      const Eigen::AngleAxisd heading(m.turn_rate_radps * (t_s + m.lag_s), Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d tag =
          path(m, t_s + m.lag_s) + heading * m.arm_error_m + Eigen::Vector3d(0, 0, m.lever_up_m);
      range.distance_m = (tag - m.anchors[a]).norm() + m.bias_m + m.noise_m * noise(random);
      if (a < m.delays_m.size()) range.distance_m += m.delays_m[a];
      if (uniform(random) < m.nlos_share) range.distance_m += 0.3 + 1.7 * uniform(random);
      flight.ranges.push_back(range);
    }
  }
  for (std::size_t a = 0; m.pairs && a < m.anchors.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      Range range;
      range.kind = RangeKind::anchor_anchor;
      range.time = UtcTime::from_seconds(1.0);
      range.tag = NetworkId{static_cast<std::uint32_t>(0x6000 + b)};
      range.anchor = NetworkId{static_cast<std::uint32_t>(0x6000 + a)};
      range.distance_m = (m.anchors[a] - m.anchors[b]).norm() + 0.1 + 0.02 * noise(random);
      flight.ranges.push_back(range);
    }
  }
  return flight;
}

}  // namespace anchord::testing
