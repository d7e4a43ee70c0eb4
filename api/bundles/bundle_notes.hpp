#pragma once

#include <vector>

#include "api/bundles/routes.hpp"

namespace anchord {
class AccessStore;
}

namespace anchord::api {

class FlightEvents;

/// What a bundle tells of its flight beside the rows: events.ndjson, and audit.ndjson for who may read the
/// audit log.
std::vector<BundleNote> bundle_notes(const FlightEvents& events, AccessStore& audit, const Mission& mission,
                                     const Principal& who);

}  // namespace anchord::api
