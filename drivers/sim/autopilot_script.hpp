#pragma once

#include <istream>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "drivers/sim/autopilot.hpp"

namespace anchord::sim {

/// One thing that happens to the simulated autopilot, in words: "pilot LOITER", "refuse Throttle too high".
/// drivers/sim/autopilot.md has them all. errors  invalid_argument, naming the word
Result<void> happen(AutopilotSim& autopilot, std::string_view words);

/// Lines of "seconds words", in any order; # begins a remark.
class AutopilotScript {
 public:
  /// errors  invalid_argument, naming the line
  static Result<AutopilotScript> read(std::istream& in);
  /// What is due by now; each once. Says what happened, a line each.
  std::vector<std::string> due(AutopilotSim& autopilot);

 private:
  struct Line {
    double at_s{};
    std::string words;
  };
  std::vector<Line> lines_;
  std::size_t next_{0};
};

}  // namespace anchord::sim
