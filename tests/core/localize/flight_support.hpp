#pragma once

#include <cmath>
#include <random>

#include "core/types/flight_data.hpp"

namespace anchord::testing {

/// What a simulated flight is made with; every systematic effect starts at none.
struct MadeFlight {
  std::vector<Eigen::Vector3d> anchors{{12, 2, 1.5}, {-10, 8, 6}, {3, -14, 2}, {-6, -9, 9}};
  double bias_m{0}, lag_s{0}, noise_m{0.05}, lever_up_m{0};
  double duration_s{120};
  double height_swing_m{5};              ///< 0: one plane
  double width_m{15};                    ///< across; small: a line
  double nlos_share{0};                  ///< ranges with 0.3 to 2 m excess
  Eigen::Vector3d arm_error_m{0, 0, 0};  ///< the antenna against where it is declared, body frame
  std::vector<double> delays_m;          ///< of each anchor; missing: none
  double turn_rate_radps{0};             ///< of the heading, which otherwise stays east
  bool pairs{false};                     ///< ranges between the anchors too, all 0.1 m long
  TrackFrame frame{TrackFrame::local};
  Wgs84 origin{50.8789, 4.7005, 80.0};
  std::uint64_t seed{1};
};

/// The same, with a heading that turns.
inline MadeFlight turning(std::uint64_t seed) {
  MadeFlight made;
  made.turn_rate_radps = 0.2;
  made.seed = seed;
  return made;
}

/// Position on a Lissajous path at time t: in local metres, so truth is known in closed form.
inline Eigen::Vector3d path(const MadeFlight& m, double t_s) {
  return {18 * std::sin(0.13 * t_s), m.width_m * std::cos(0.17 * t_s),
          6 + m.height_swing_m * std::sin(0.29 * t_s)};
}

FlightData make_flight(const MadeFlight& m);

}  // namespace anchord::testing
