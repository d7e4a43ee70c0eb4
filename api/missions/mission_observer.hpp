#pragma once

#include "core/flight/pilot.hpp"

namespace anchord::api {

/// What a mission's live path tells whoever flies by it. on_fix is called by the thread that brings the fix,
/// on_range on the mission's strand: be brief.
class MissionObserver : public flight::Pilot {
 public:
  /// Whether its flight is in the air, so that its mission stays in memory. Called with no lock held.
  virtual bool flies(const MissionId& mission) = 0;
};

}  // namespace anchord::api
