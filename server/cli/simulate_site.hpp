#pragma once

namespace CLI {
class App;
}

namespace anchord::cli {

/// Adds `site` to the command `simulate`: what a server in use holds, added to one that has nothing.
void add_simulate_site(CLI::App& simulate, int& exit_code);

}  // namespace anchord::cli
