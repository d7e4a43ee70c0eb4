#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/kit_profile.hpp"
#include "core/ports/kit_store.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord::api {

/// Profiles of kits as the service keeps them. A factor's `flight` is "<mission name> [<mission id>]", so
/// that a flight solved again replaces what it said before. Thread-safe.
class KitProfiles {
 public:
  KitProfiles(KitStore& kits, MissionStore& missions, const Clock& clock)
      : kits_(kits), missions_(missions), clock_(clock) {}

  /// The kit a device belongs to: a kit's own name, or the kit of the newest mission that flew this tag.
  /// not_found otherwise.
  Result<std::string> kit_of(const std::string& device);
  /// Stored profile without what these flights said themselves, for solving them again; nothing for a kit
  /// without one.
  struct InUse {
    KitProfile profile;
    std::uint64_t version{};
  };
  Result<std::optional<InUse>> for_flights(const std::string& kit, const std::vector<Mission>& flights);
  /// Factors of `flights` in `learned` replace those of the same flights; others stay. Nothing is written
  /// when nothing changes. Tries again when another calibration wrote in between.
  Result<std::optional<StoredProfile>> learn(const KitProfile& learned, const std::vector<Mission>& flights,
                                             const std::string& source);

  static std::string flight_key(const Mission& mission);
  KitStore& store() { return kits_; }

 private:
  KitStore& kits_;
  MissionStore& missions_;
  const Clock& clock_;
};

}  // namespace anchord::api
