#pragma once

#include <string>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/flight/control_lease.hpp"

namespace anchord::api {

struct Principal;

/// What the routes of missions ask of whoever flies them.
class MissionControl {
 public:
  virtual ~MissionControl() = default;
  virtual bool flies(const MissionId& mission) = 0;
  // errors: conflict (no control, or another's), not_found
  virtual Result<flight::Lease> renew_control(const MissionId& mission, const std::string& key,
                                              const Principal& who) = 0;
  virtual Result<void> release_control(const MissionId& mission, const std::string& key,
                                       const Principal& who) = 0;
};

}  // namespace anchord::api
