#pragma once

#include <map>
#include <optional>
#include <string>

#include "core/flight/live_mission.hpp"
#include "core/flight/position_watch.hpp"
#include "core/localize/live_flight.hpp"
#include "core/types/estimate.hpp"
#include "core/types/mission.hpp"

namespace anchord::api {

/// Objects of the live topics, written by std::to_chars: 100 ranges a second to 50 browsers leave no time for
/// a DOM. Keys are those of tests/data/wire/topic.*.json; metres have 4 decimals, degrees 9.
std::string live_pose_json(const MissionId& mission, TrackFrame frame, const flight::PoseMoved& pose);
std::string live_rtk_json(const MissionId& mission, const Fix& fix);
std::string live_range_json(const MissionId& mission, const RangeResult& result);
std::string live_fix_json(const MissionId& mission, const Fix& fix);
/// models_moved_m  how far the anchor stands from where the same ranges put it without the promoted models;
/// absent: no range of it was corrected, and the key is not there
std::string live_estimate_json(const MissionId& mission, const Estimate& estimate,
                               std::optional<double> models_moved_m = {});

std::string mission_state_json(const Mission& mission, const flight::LiveState& state);

}  // namespace anchord::api
