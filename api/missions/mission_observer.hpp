#pragma once

#include "core/base/ids.hpp"

namespace anchord {
struct Fix;
struct RangeResult;
}  // namespace anchord

namespace anchord::api {

/// What a mission's live path tells whoever flies by it. on_fix is called by the thread that brings the fix,
/// on_range on the mission's strand: be brief.
class MissionObserver {
 public:
  virtual ~MissionObserver() = default;
  virtual void on_fix(const Fix& fix) = 0;
  virtual void on_range(const MissionId& mission, const RangeResult& result) = 0;
  /// Whether its flight is in the air, so that its mission stays in memory. Called with no lock held.
  virtual bool flies(const MissionId& mission) = 0;
};

}  // namespace anchord::api
