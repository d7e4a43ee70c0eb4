#pragma once

#include <gtest/gtest.h>

#include "air_rig.hpp"

namespace anchord::test {
namespace {

using drone::Autopilot;
using procedure::Step;
using Failsafe = sim::AutopilotSim::Failsafe;

class Conditions : public ::testing::TestWithParam<Autopilot> {
 protected:
  sim::AutopilotOptions options() const {
    sim::AutopilotOptions o;
    o.dialect = GetParam();
    return o;
  }
  const drone::Dialect& dialect() const { return drone::dialect_of(GetParam()); }
  /// A mode that the server never commands: LOITER, POSCTL.
  std::uint32_t pilots() const { return GetParam() == Autopilot::px4 ? 3U << 16U : 5U; }
  static std::string kinds(const std::vector<AirRig::Wire>& wire) {
    std::string out;
    for (const auto& w : wire) out += std::to_string(w.command) + ' ';
    return out;
  }
};

}  // namespace
}  // namespace anchord::test
