#include "server/flight/demonstration_campaign.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>

#include "drivers/sim/scenario.hpp"
#include "drivers/sim/tag_reading.hpp"

namespace anchord::flight {
namespace {

constexpr int k_repeats = 4;
constexpr std::array<std::string_view, 6> k_environments{"hall",     "office", "stairwell",
                                                         "workshop", "depot",  "yard"};
constexpr std::array k_distances_m{4.0, 7.0, 11.0, 15.0, 20.0, 26.0, 33.0, 40.0};

/// What stands between the two devices; up to two slabs one behind the other.
struct Obstacle {
  std::string_view name;
  sim::Material first{}, second{};
  double first_m{}, second_m{};
};
constexpr std::array k_obstacles{
    Obstacle{"", {}, {}, 0, 0},
    Obstacle{"", {}, {}, 0, 0},
    Obstacle{"glass", sim::k_glass, {}, 0.012, 0},
    Obstacle{"glass", sim::k_glass, sim::k_glass, 0.012, 0.012},
    Obstacle{"plasterboard", sim::k_plasterboard, {}, 0.05, 0},
    Obstacle{"brick", sim::k_brick, {}, 0.22, 0},
    Obstacle{"concrete", sim::k_concrete, {}, 0.2, 0},
    Obstacle{"concrete", sim::k_concrete, {}, 0.25, 0},
    Obstacle{"brick and glass", sim::k_brick, sim::k_glass, 0.22, 0.012},
    Obstacle{"brick and concrete", sim::k_brick, sim::k_concrete, 0.22, 0.2},
};

sim::Panel slab_at(double x_m, const sim::Material& material, double thickness_m) {
  constexpr double k_wide_m = 100;
  return {{x_m, -k_wide_m, -k_wide_m}, {0, 2 * k_wide_m, 0}, {0, 0, 2 * k_wide_m}, thickness_m, material, {}};
}

struct Arrangement {
  CampaignSite site;
  sim::World world;
  sim::Terminal tag, anchor;
};

double rounded_mm(double value_m) { return std::round(value_m * 1000) / 1000; }

/// The obstacle stands half-way, and the line meets it at up to 60 degrees off its normal, as in a flight
/// along a front.
Arrangement arrange(std::string_view environment, double about_m, const Obstacle& obstacle,
                    sim::Random& random) {
  constexpr double k_degree = std::numbers::pi / 180;
  const double distance_m = about_m * (0.9 + 0.2 * random.uniform());
  const double height_m = std::min(10.0, 0.6 * distance_m) * random.uniform();
  const double slant_rad = 60 * k_degree * random.uniform();
  const double heading_deg = std::floor(360 * random.uniform());
  const double level_m = std::sqrt(distance_m * distance_m - height_m * height_m);
  Arrangement out;
  out.anchor.enu_m = {level_m * std::cos(slant_rad), level_m * std::sin(slant_rad), height_m};
  out.tag.heading_rad = heading_deg * k_degree;
  const double half_m = out.anchor.enu_m.x() / 2;
  if (obstacle.first_m > 0)
    out.world.panels.push_back(slab_at(half_m - 0.5, obstacle.first, obstacle.first_m));
  if (obstacle.second_m > 0)
    out.world.panels.push_back(slab_at(half_m + 0.5, obstacle.second, obstacle.second_m));
  out.site.environment = environment;
  out.site.material = obstacle.name;
  out.site.distance_m = rounded_mm((out.anchor.enu_m - out.tag.enu_m).norm());
  out.site.height_m = rounded_mm(height_m);
  out.site.heading_deg = heading_deg;
  if (obstacle.first_m > 0) out.site.thickness_m = obstacle.first_m + obstacle.second_m;
  return out;
}

CampaignMeasurement measurement_of(const Range& range, std::size_t site) {
  CampaignMeasurement out;
  out.site = site;
  out.range_m = range.distance_m;
  out.rx_dbm = range.rx_dbm ? range.rx_dbm : range.rss_dbm;
  out.fp_dbm = range.fp_dbm;
  out.std_noise = range.std_noise;
  out.cir = range.cir;
  return out;
}

}  // namespace

Campaign demonstration_campaign() {
  Campaign out;
  sim::Random random(7);
  const auto radio = sim::scenario_radio();
  for (const auto environment : k_environments) {
    // Each environment is measured with another anchor of the kit.
    const double bias_m = radio.anchor_bias_sigma_m * random.normal();
    for (const double about_m : k_distances_m) {
      for (const auto& obstacle : k_obstacles) {
        auto set_up = arrange(environment, about_m, obstacle, random);
        set_up.anchor.bias_m = bias_m;
        const std::size_t site = out.sites.size();
        set_up.site.name = std::string(environment) + '-' + std::to_string(site + 1);
        for (int i = 0; i < k_repeats; ++i) {
          const auto exchange =
              sim::simulate_exchange(set_up.world, radio, set_up.tag, set_up.anchor, random);
          if (!exchange) continue;
          set_up.site.los = exchange->line_of_sight;
          Range range;
          sim::read_as_tag(range, *exchange, {}, random);
          out.measurements.push_back(measurement_of(range, site));
        }
        if (set_up.site.los) out.sites.push_back(set_up.site);
      }
    }
  }
  return out;
}

}  // namespace anchord::flight
