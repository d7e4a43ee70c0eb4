#pragma once

#include "core/base/ids.hpp"

namespace anchord {
struct Fix;
struct RangeResult;
}  // namespace anchord

namespace anchord::flight {

/// Whoever flies by what a mission measures.
class Pilot {
 public:
  virtual ~Pilot() = default;
  virtual void on_fix(const Fix& fix) = 0;
  virtual void on_range(const MissionId& mission, const RangeResult& result) = 0;
};

}  // namespace anchord::flight
