#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss {

std::optional<Fix> to_fix(const Epoch& epoch, const MissionId& mission) {
  if (!epoch.time || !epoch.lat_deg || !epoch.lon_deg || !epoch.height_ellipsoid_m) return std::nullopt;
  Fix out;
  out.mission = mission;
  out.time = *epoch.time;
  out.position = {*epoch.lat_deg, *epoch.lon_deg, *epoch.height_ellipsoid_m};
  out.fix = epoch.fix;
  out.correction_age_s = epoch.age_s;
  out.satellites = epoch.satellites;
  if (epoch.covariance_enu_m2) {
    out.covariance_m2 = epoch.covariance_enu_m2;
  } else if (epoch.sigma_e_m && epoch.sigma_n_m && epoch.sigma_u_m) {
    const Eigen::Vector3d sigma{*epoch.sigma_e_m, *epoch.sigma_n_m, *epoch.sigma_u_m};
    out.covariance_m2 = sigma.cwiseAbs2().asDiagonal().toDenseMatrix();
  }
  return out;
}

void Skips::count(std::string_view reason, std::uint64_t offset, std::string_view bytes, std::uint64_t n) {
  auto it = entries_.find(reason);
  if (it == entries_.end()) {
    Entry entry{0, offset, {}};
    for (const char c : bytes.substr(0, 160)) entry.example += c >= 0x20 && c < 0x7f ? c : '.';
    it = entries_.emplace(std::string(reason), std::move(entry)).first;
  }
  it->second.count += n;
}

std::uint64_t Skips::operator[](std::string_view reason) const {
  const auto it = entries_.find(reason);
  return it == entries_.end() ? 0 : it->second.count;
}

}  // namespace anchord::gnss
