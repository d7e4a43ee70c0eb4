#pragma once

#include <cstdint>
#include <map>
#include <memory>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/types/plan.hpp"

namespace anchord {
class PlaceStore;
}

namespace anchord::api {

/// What was accepted of the floor plans of a site, read once after each change: pages ask for the check of a
/// plan every second. Thread-safe.
class SiteStructures {
 public:
  explicit SiteStructures(PlaceStore& places) : places_(places) {}

  /// A building, a floor or what is accepted of it was changed: the next reader reads anew.
  void changed();
  /// Joins it to a plan with a site; one without gets none. errors: those of the store
  Result<void> join(Plan& plan);

 private:
  using Shared = std::shared_ptr<const SiteStructure>;
  Result<Shared> of(const SiteId& site);
  Result<SiteStructure> read(const SiteId& site);

  struct Kept {
    std::uint64_t change{1};
    std::map<SiteId, Shared> of_site;
  };
  PlaceStore& places_;
  Locked<Kept> kept_;
};

}  // namespace anchord::api
