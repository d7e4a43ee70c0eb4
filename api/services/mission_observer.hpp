#pragma once

#include "core/base/ids.hpp"

namespace anchord {
struct Fix;
struct RangeResult;
}  // namespace anchord

namespace anchord::api {

/// What a mission's live path tells whoever flies by it. Called on the mission's strand: be brief.
class MissionObserver {
 public:
  virtual ~MissionObserver() = default;
  virtual void on_fix(const Fix& fix) = 0;
  virtual void on_range(const MissionId& mission, const RangeResult& result) = 0;
};

}  // namespace anchord::api
