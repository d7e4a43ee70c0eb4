#include "server/cli/simulate_devices.hpp"

#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "drivers/sim/rig.hpp"
#include "drivers/sim/scenario_file.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/progress.hpp"

namespace anchord::cli {
namespace {

namespace fs = std::filesystem;
using Ordered = nlohmann::ordered_json;

Ordered text_or_null(const std::string& text) { return text.empty() ? Ordered(nullptr) : Ordered(text); }

void print(const sim::ServedDevice& d, bool json) {
  if (json) {
    const Ordered line{{"name", d.name},
                       {"kind", d.kind},
                       {"format", text_or_null(d.format)},
                       {"pty", text_or_null(d.pty)},
                       {"link", text_or_null(d.link)},
                       {"port", d.tcp_port != 0 ? Ordered(d.tcp_port) : Ordered(nullptr)},
                       {"address", d.address},
                       {"plugged", d.plugged}};
    std::printf("%s\n", to_wire(line).c_str());
  } else {
    std::printf("%-12s %-6s %-5s %s%s\n", d.name.c_str(), d.kind.c_str(), d.format.c_str(), d.address.c_str(),
                d.plugged ? (d.link.empty() ? "" : (" -> " + d.pty).c_str()) : " (unplugged)");
  }
  std::fflush(stdout);
}

/// Whoever flies by commands on standard input.
class Commands {
 public:
  explicit Commands(const sim::Scenario& scenario)
      : mover_(sim::FlightPath(scenario.path, scenario.speed_mps, false).at(0), scenario.speed_mps) {}
  sim::Pose at(double now_s) {
    // Devices ask for instants a little in the past as well; the aircraft is where it was asked for last.
    newest_s_ = std::max(newest_s_, now_s);
    return mover_.at(newest_s_);
  }
  /// False at the end of input.
  bool read(sim::Rig& rig) {
    char buffer[4096];
    const auto n = ::read(STDIN_FILENO, buffer, sizeof buffer);
    if (n <= 0) return false;
    text_.append(buffer, static_cast<std::size_t>(n));
    for (auto end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
      obey(text_.substr(0, end), rig);
      text_.erase(0, end + 1);
    }
    return text_.size() < 4096;
  }

 private:
  void obey(const std::string& line, sim::Rig& rig) {
    std::istringstream in(line);
    std::string word, name;
    Eigen::Vector3d to;
    double value = 0;
    in >> word;
    if (word == "go_to" && in >> to.x() >> to.y() >> to.z()) {
      const bool turned = static_cast<bool>(in >> value);
      mover_.go_to(to, turned ? std::optional(value * 0.017453292519943295) : std::nullopt);
    } else if (word == "speed" && in >> value && value > 0 && value < 100) {
      mover_.set_speed(value);
    } else if ((word == "plug" || word == "unplug") && in >> name && rig.plug(name, word == "plug")) {
      return;
    } else if (!word.empty()) {
      std::fprintf(stderr,
                   "anchord simulate: unknown command: %s (go_to E N U [HEADING_DEG], speed MPS, plug NAME, "
                   "unplug NAME)\n",
                   line.c_str());
    }
  }
  sim::LiveMover mover_;
  double newest_s_{0};
  std::string text_;
};

/// A folder for the links, gone with the process.
struct Links {
  fs::path folder;
  bool own{false};
  ~Links() {
    std::error_code ignored;
    if (own) fs::remove_all(folder, ignored);
  }
};

}  // namespace

int simulate_devices(const SimulateDevices& options) {
  auto scenario = sim::read_scenario(options.scenario);
  if (!scenario) return failed("anchord simulate", scenario.error().message, 2);
  if (options.seed) scenario.value().seed = *options.seed;
  // Absolute, since an address is.
  Links links{options.links.empty() ? fs::path() : fs::absolute(options.links), options.links.empty()};
  std::error_code error;
  if (links.own) {
    links.folder = fs::temp_directory_path() / ("anchord-simulate-" + std::to_string(::getpid()));
  }
  fs::create_directories(links.folder, error);
  if (error) return failed("anchord simulate", links.folder.string() + ": " + error.message(), 1);
  const auto shared = std::make_shared<const sim::Scenario>(std::move(scenario).value());
  Commands commands(*shared);
  sim::RigOptions rig_options;
  rig_options.links_folder = links.folder.string();
  if (options.live) rig_options.pilot = [&commands](double now_s) { return commands.at(now_s); };
  auto opened = sim::Rig::open(shared, rig_options);
  if (!opened) return failed("anchord simulate", opened.error().message, 1);
  auto& rig = *opened.value();
  for (const auto& device : rig.devices()) print(device, options.json);
  rig.on_change([&](const sim::ServedDevice& device) { print(device, options.json); });
  bool listening = options.live;
  while (!interrupted() && (options.duration_s <= 0 || rig.now_s() < options.duration_s)) {
    rig.step(50, listening ? STDIN_FILENO : -1);
    if (!listening) continue;
    fd_set ready;
    FD_ZERO(&ready);
    FD_SET(STDIN_FILENO, &ready);
    timeval now{};
    if (::select(STDIN_FILENO + 1, &ready, nullptr, nullptr, &now) > 0) listening = commands.read(rig);
  }
  return 0;
}

}  // namespace anchord::cli
