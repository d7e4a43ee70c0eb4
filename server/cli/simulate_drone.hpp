#pragma once

namespace CLI {
class App;
}

namespace anchord::cli {

/// Adds `drone` to the command `simulate`.
void add_simulate_drone(CLI::App& simulate, int& exit_code);

}  // namespace anchord::cli
