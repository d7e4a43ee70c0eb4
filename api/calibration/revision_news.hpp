#pragma once

#include "api/calibration/routes.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

/// Whoever waits for a new revision learns of it: streams, events, the watch for contradictions.
void announce_revision(CalibrationApi& s, const Revision& revision, std::size_t anchors,
                       std::size_t overrides);

}  // namespace anchord::api
