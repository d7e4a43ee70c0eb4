#include "api/calibration/kit_profiles.hpp"

#include <algorithm>

#include "api/calibration/kit_profile_json.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_missions_searched = 1000;

/// The command line knows a flight by its name alone: a profile made there and put here names it so.
bool of_these(const ProfileFactor& factor, const std::vector<Mission>& flights) {
  return std::ranges::any_of(flights, [&](const Mission& mission) {
    return factor.flight == KitProfiles::flight_key(mission) || factor.flight == mission.name;
  });
}

}  // namespace

std::string KitProfiles::flight_key(const Mission& mission) {
  return mission.name + " [" + to_string(mission.id) + "]";
}

Result<std::string> KitProfiles::kit_of(const std::string& device) {
  BOOST_OUTCOME_TRY(const auto stored, kits_.profile(device));
  if (stored) return device;
  const auto network_id = parse_network_id(device);
  BOOST_OUTCOME_TRY(const auto missions, missions_.missions(k_missions_searched, std::nullopt));
  for (const auto& mission : missions) {
    if (mission.kit.empty()) continue;
    if (mission.kit == device) return device;
    const bool flew = network_id && std::ranges::any_of(mission.tags, [&](const TagAntenna& antenna) {
                        return antenna.tag == network_id.value();
                      });
    if (flew) return mission.kit;
  }
  return make_error(Errc::not_found,
                    "there is no kit, and no tag of a kit, with the name " + to_utf8(device, 60));
}

Result<std::optional<KitProfiles::InUse>> KitProfiles::for_flights(const std::string& kit,
                                                                   const std::vector<Mission>& flights) {
  BOOST_OUTCOME_TRY(const auto stored, kits_.profile(kit));
  if (!stored) return std::optional<InUse>{};
  InUse out;
  out.version = stored->version;
  BOOST_OUTCOME_TRY(out.profile, parse_kit_profile(stored->profile.text));
  std::erase_if(out.profile.factors, [&](const ProfileFactor& f) { return of_these(f, flights); });
  return std::optional<InUse>(std::move(out));
}

Result<std::optional<StoredProfile>> KitProfiles::learn(const KitProfile& learned,
                                                        const std::vector<Mission>& flights,
                                                        const std::string& source) {
  for (int attempt = 0;; ++attempt) {
    BOOST_OUTCOME_TRY(const auto stored, kits_.profile(learned.kit));
    KitProfile next;
    if (stored) {
      BOOST_OUTCOME_TRY(next, parse_kit_profile(stored->profile.text));
    }
    next.kit = learned.kit;
    std::erase_if(next.factors, [&](const ProfileFactor& f) { return of_these(f, flights); });
    for (const auto& factor : learned.factors) {
      if (of_these(factor, flights)) next.factors.push_back(factor);
    }
    StoredProfile kept;
    kept.kit = learned.kit;
    kept.time = clock_.now();
    kept.source = source;
    kept.profile = {kit_profile_json(next)};
    if (next.factors.empty() || (stored && stored->profile == kept.profile))
      return std::optional<StoredProfile>{};
    auto put = kits_.put(std::move(kept), stored ? stored->version : 0);
    if (put) return std::optional<StoredProfile>(std::move(put).value());
    if (put.error().code != Errc::conflict || attempt == 4) return put.error();
  }
}

}  // namespace anchord::api
