#pragma once

#include <optional>
#include <string>

namespace anchord::procedure {

/// When an anchor's sub-procedure ends (8.4.4). Every limit that is set is checked; a goal needs
/// `min_iterations`.
struct ExitRule {
  int min_iterations = 4;
  int max_iterations = 40;
  std::optional<double> target_sigma_m{};  ///< predicted or estimated position sigma
  std::optional<double> gdop_root{};       ///< conventional GDOP: square root of the trace of eq 8.5
  std::optional<double> max_s{};
  double min_battery = 0.3;  ///< share left, 0..1
};
struct Progress {
  int iterations{};
  std::optional<double> sigma_m{}, gdop_root{}, battery{};
  double elapsed_s{};
};
struct Exit {
  bool reached{};      ///< the goal; false: a limit ended it
  std::string reason;  ///< for the operator, with the numbers
};

/// Nothing while it should go on. A low battery comes first, then the goals, then time and iterations.
std::optional<Exit> exit_of(const ExitRule& rule, const Progress& now);

}  // namespace anchord::procedure
