#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "api/formats/flight_folder.hpp"
#include "core/base/text.hpp"
#include "core/base/whole_file.hpp"
#include "drivers/sim/flight.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/simulate_devices.hpp"
#include "server/cli/simulate_drone.hpp"
#include "server/cli/simulate_site.hpp"

namespace anchord::cli {
namespace {

/// For judging only, never read by the product: the layout of the other flight folders' anchors_truth.csv.
Result<void> write_truth(const sim::SimulatedFlight& flight, const std::filesystem::path& path) {
  WholeFile file(path);
  file.out() << "anchor_id,lat_deg,lon_deg,alt_m,e_m,n_m,u_m\n";
  for (const auto& [id, at] : flight.truth_wgs84) {
    const Eigen::Vector3d& enu_m = flight.truth_enu_m.at(id);
    char line[200];
    std::snprintf(line, sizeof line, "%s,%.10f,%.10f,%.4f,%.4f,%.4f,%.4f\n", to_string(id).c_str(),
                  at.lat_deg, at.lon_deg, at.height_m, enu_m.x(), enu_m.y(), enu_m.z());
    file.out() << line;
  }
  return file.put_in_place();
}

/// Whether a flight is there that somebody flew: nothing brings it back once it is overwritten.
bool holds_a_real_flight(const std::filesystem::path& folder) {
  std::ifstream in(folder / "flight.json", std::ios::binary);
  if (!in) return false;
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  return text.find(R"("name": "simulated flight, seed )") == std::string::npos;
}

int simulate(const sim::SimulationOptions& options, const std::filesystem::path& folder) {
  if (holds_a_real_flight(folder)) {
    std::fprintf(
        stderr,
        "anchord simulate: %s has a flight that was not simulated, which would be overwritten: choose "
        "another folder\n",
        printable(folder.string()).c_str());
    return 2;
  }
  const auto flight = sim::simulate_flight(sim::demonstration_world(), options);
  if (!flight) {
    std::fprintf(stderr, "anchord simulate: %s\n", printable(flight.error().message).c_str());
    return 2;
  }
  // Of the flight that was there: it would leave out rows of this one.
  std::error_code none;
  std::filesystem::remove(folder / "exclusions.json", none);
  if (const auto written = write_flight_folder(flight.value().data, folder); !written)
    return failed("anchord simulate", written.error().message);
  if (const auto written = write_truth(flight.value(), folder / "anchors_truth.csv"); !written)
    return failed("anchord simulate", written.error().message);
  std::fprintf(stderr, "%s: %zu ranges of %zu anchors, %zu fixes, %.0f s, seed %llu\n", folder.c_str(),
               flight.value().data.ranges.size(), flight.value().truth_wgs84.size(),
               flight.value().data.fixes.size(), options.duration_s,
               static_cast<unsigned long long>(options.seed));
  return 0;
}

}  // namespace

void add_simulate_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "simulate", "Provide simulated devices on ptys and TCP ports, or generate a flight without a drone");
  command->require_subcommand(0, 1);
  auto devices = std::make_shared<SimulateDevices>();
  command
      ->add_option("SCENARIO", devices->scenario,
                   "Scenario file (docs/formats.md), or demonstration: a tag on a pty, a rover on TCP")
      // Here and not when it is read: a slip in the name of a command is then recognized as one.
      ->check([](const std::string& file) {
        std::error_code ignored;
        return file == "demonstration" || std::filesystem::exists(file, ignored)
                   ? std::string()
                   : file + ": there is no such file; \"demonstration\" is built in";
      });
  command->add_flag("--json", devices->json,
                    "Print one JSON object per device and line, again after each plug");
  command->add_option("--seed", devices->seed, "Seed, instead of that of the scenario");
  command->add_option("--duration", devices->duration_s, "Seconds until it ends [until Ctrl-C]");
  command->add_option("--links", devices->links,
                      "Folder for links to the ptys; the links stay valid after a replug");
  command->add_flag(
      "--live", devices->live,
      "Fly by commands on standard input: go_to E N U [HEADING_DEG], speed MPS, plug NAME, unplug NAME");
  command->callback([devices, command, &exit_code] {
    if (!command->get_subcommands().empty()) return;
    if (devices->scenario.empty()) throw CLI::RequiredError("SCENARIO");
    exit_code = simulate_devices(*devices);
  });
  auto* flight = command->add_subcommand(
      "flight", "Generate a seeded flight round the demonstration building, as a flight folder");
  auto options = std::make_shared<sim::SimulationOptions>();
  auto folder = std::make_shared<std::string>();
  flight->add_option("--seed", options->seed, "Seed; the same seed gives the same flight")
      ->capture_default_str();
  flight->add_option("--out", *folder, "Folder to write; created if it does not exist")->required();
  flight->add_option("--duration", options->duration_s, "Seconds of flight")->capture_default_str();
  flight->add_option("--rate", options->range_rate_hz, "Attempted ranges per second, over all anchors")
      ->capture_default_str();
  flight->add_option("--fix-rate", options->fix_rate_hz, "RTK epochs per second")->capture_default_str();
  flight->callback([options, folder, &exit_code] { exit_code = simulate(*options, *folder); });
  add_simulate_drone(*command, exit_code);
  add_simulate_site(*command, exit_code);
}

}  // namespace anchord::cli
