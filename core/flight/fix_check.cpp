#include "core/flight/fix_check.hpp"

#include <utility>

namespace anchord::flight {

FixCheck::FixCheck(TrackFrame frame, const TrackLimits& limits, std::vector<Exclusion> exclusions,
                   const std::optional<Fix>& last)
    : track_(frame, {.limits = limits}), exclusions_(std::move(exclusions)) {
  if (last) track_.add(*last);
}

bool FixCheck::believes(const Fix& fix) { return !excluded(exclusions_, fix) && track_.add(fix).believed; }

}  // namespace anchord::flight
