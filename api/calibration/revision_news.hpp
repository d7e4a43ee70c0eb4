#pragma once

#include "api/calibration/routes.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

/// Whoever waits for a new revision learns of it: streams, events, the watch for contradictions.
void announce_revision(CalibrationApi& s, const Revision& revision, std::size_t anchors,
                       std::size_t overrides);

/// A flight came with a bundle, and published revisions with it or not.
void announce_bundle(CalibrationApi& s, const MissionId& mission, const std::string& text,
                     bool with_revisions);

}  // namespace anchord::api
