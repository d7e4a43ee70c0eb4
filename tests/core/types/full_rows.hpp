#pragma once

#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord::testing {

/// A range with every number a tag gives, of values that need all their digits.
inline Range full_range(const MissionId& mission) {
  Range r;
  r.mission = mission;
  r.time = UtcTime::from_us(1'777'889'472'123'456);
  r.received = UtcTime::from_us(1'777'889'472'143'457);
  r.tag = {0x6e01};
  r.antenna = 2;
  r.anchor = {0xdeadbeef};
  r.seq = 4'000'000'123;
  r.distance_m = 0.1 + 0.2;
  r.rss_dbm = -78.25;
  r.fp_dbm = -81.0 / 3;
  r.rx_dbm = -79;
  r.std_noise = 44;
  r.heading_deg = 359.99999999;
  return r;
}

/// A fix with covariance, attitude and all that a rover tells beside.
inline Fix full_fix(const MissionId& mission) {
  Fix f;
  f.mission = mission;
  f.time = UtcTime::from_us(1'777'889'472'200'000);
  f.seq = 7;
  f.position = {48.137154321987, 11.576124123456, 521.1234};
  f.fix = FixClass::rtk_fixed;
  Eigen::Matrix3d c;
  c << 1e-4, 1e-6, -2e-6, 1e-6, 1.1e-4, 3e-6, -2e-6, 3e-6, 4e-4;
  f.covariance_m2 = c;
  f.enu_from_body = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  f.correction_age_s = 0.7;
  f.satellites = 21;
  return f;
}

}  // namespace anchord::testing
