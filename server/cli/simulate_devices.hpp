#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace anchord::cli {

struct SimulateDevices {
  std::string scenario;  ///< file, or "demonstration"
  std::string links;     ///< folder for links to ptys; empty: one of its own
  std::optional<std::uint64_t> seed{};
  double duration_s{0};  ///< 0: until Ctrl-C
  bool json{false}, live{false};
};

/// `anchord simulate SCENARIO`: devices on ptys and TCP ports until Ctrl-C. Exit code.
int simulate_devices(const SimulateDevices& options);

}  // namespace anchord::cli
