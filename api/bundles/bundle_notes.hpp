#pragma once

#include <string>
#include <vector>

#include "api/bundles/routes.hpp"
#include "core/types/live_event.hpp"

namespace anchord {
class AccessStore;
}

namespace anchord::api {

class FlightEvents;
class ZipReader;
struct BundleManifest;

/// What a bundle tells of its flight beside the rows: events.ndjson, and audit.ndjson for who may read the
/// audit log.
std::vector<BundleNote> bundle_notes(const FlightEvents& events, AccessStore& audit, const Mission& mission,
                                     const Principal& who);

/// The events in the notes of a bundle, in the order in which they came; none where it has no such
/// note. errors: those of the zip file; bad_frame, naming the line that is none
Result<std::vector<LiveEvent>> noted_events(const ZipReader& zip, const BundleManifest& manifest);

}  // namespace anchord::api
