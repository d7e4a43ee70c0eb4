#pragma once

#include <cstddef>
#include <vector>

#include "server/gateway/batch.hpp"

namespace anchord::cli {

/// Of which missions the rows of a recording are. A gateway records rows before it knows a mission, under
/// gateway::unassigned(): they belong to the first mission that the recording names afterwards.
class ReplayMissions {
 public:
  /// Of every row once, in their order.
  void note(const MissionId& mission) {
    if (order_.empty() || order_.back() != mission) order_.push_back(mission);
  }
  /// Of every row again, in the same order; unassigned() where none is named afterwards.
  MissionId of(const MissionId& mission) {
    while (at_ < order_.size() && order_[at_] != mission) ++at_;
    if (mission != gateway::unassigned()) return mission;
    for (std::size_t i = at_; i < order_.size(); ++i)
      if (order_[i] != mission) return order_[i];
    return mission;
  }

 private:
  std::vector<MissionId> order_;
  std::size_t at_{0};
};

}  // namespace anchord::cli
