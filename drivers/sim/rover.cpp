#include "drivers/sim/rover.hpp"

#include <cmath>
#include <functional>

#include "drivers/sim/wgs84.hpp"

namespace anchord::sim {
namespace {

constexpr double k_geoid_separation_m = 45.0;  ///< coarse, as receivers' built-in geoids are

std::uint64_t seed_of(const Scenario& scenario, const std::string& name) {
  // FNV-1a: std::hash may differ between libraries.
  std::uint64_t hash = 1469598103934665603u;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return scenario.seed * 0x9e3779b97f4a7c15u ^ hash;
}

}  // namespace

RoverSim::RoverSim(std::shared_ptr<const Scenario> scenario, const RoverSetup& rover, Whereabouts where,
                   UtcTime start)
    : scenario_(std::move(scenario)),
      setup_(rover),
      where_(std::move(where)),
      start_(start),
      random_(seed_of(*scenario_, rover.name)),
      noise_(~seed_of(*scenario_, rover.name)),
      error_(1 / rover.rate_hz, random_) {}

double RoverSim::next_s() const { return static_cast<double>(next_) / setup_.rate_hz + setup_.delay_s; }

void RoverSim::skip_to(double now_s) {
  while (next_s() <= now_s) {
    (void)error_.next(setup_.sigma_m);  // errors go on, so that the same epoch has the same one
    ++next_;
  }
}

RoverEpoch RoverSim::measure(double at_s, UtcTime time) {
  const auto faulty = [&](FaultKind kind) {
    return fault_at(*scenario_, setup_.name, kind, at_s) != nullptr;
  };
  RoverEpoch epoch;
  epoch.time = time;
  epoch.geoid_separation_m = k_geoid_separation_m;
  const bool is_float = faulty(FaultKind::fix_float);
  epoch.fix = faulty(FaultKind::fix_loss) ? FixClass::none
              : is_float                  ? FixClass::rtk_float
                                          : FixClass::rtk_fixed;
  epoch.sigma_enu_m = is_float ? setup_.float_sigma_m : setup_.sigma_m;
  epoch.satellites = is_float ? 11 : 19;
  epoch.age_s = is_float ? 4.0 : 0.8;
  const Pose pose = where_(at_s);
  epoch.velocity_enu_mps = pose.velocity_mps;
  epoch.position = wgs84_from_enu(scenario_->world.origin,
                                  pose.enu_m + setup_.base_error_m + error_.next(epoch.sigma_enu_m));
  return epoch;
}

std::string RoverSim::disturbed(std::string bytes) {
  if (!noise_.chance(0.3) || bytes.empty()) return bytes;
  const auto at = static_cast<std::size_t>(noise_.uniform() * static_cast<double>(bytes.size()));
  if (noise_.chance(0.5)) {
    bytes[at] = static_cast<char>(static_cast<unsigned char>(noise_.uniform() * 256));
    return bytes;
  }
  std::string noise(1 + static_cast<std::size_t>(noise_.uniform() * 40), ' ');
  for (char& c : noise) c = static_cast<char>(static_cast<unsigned char>(noise_.uniform() * 256));
  return bytes.insert(at, noise);
}

std::string RoverSim::epoch_bytes(std::uint64_t number) {
  const double at_s = static_cast<double>(number) / setup_.rate_hz;
  // Whole microseconds: receivers' epochs are round.
  const UtcTime time{start_.ns + static_cast<std::int64_t>(std::llround(at_s * 1e6)) * 1000};
  const RoverEpoch epoch = measure(at_s, time);
  if (fault_at(*scenario_, setup_.name, FaultKind::silence, at_s)) return {};
  std::string bytes = encode(epoch, setup_.format);
  return fault_at(*scenario_, setup_.name, FaultKind::garbage, at_s) ? disturbed(std::move(bytes)) : bytes;
}

std::string RoverSim::speak(double now_s) {
  std::string out;
  while (next_s() <= now_s) out += epoch_bytes(next_++);
  return out;
}

}  // namespace anchord::sim
