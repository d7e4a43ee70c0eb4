#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// What the track positions are positions of.
enum class TrackPoint : std::uint8_t { gnss_antenna, body, tag_antenna };
inline constexpr auto k_point_words = enum_table<TrackPoint>({{"gnss_antenna", TrackPoint::gnss_antenna},
                                                              {"body", TrackPoint::body},
                                                              {"tag_antenna", TrackPoint::tag_antenna}});

/// One UWB antenna of the aircraft.
struct TagAntenna {
  NetworkId tag{};
  std::uint8_t antenna{0};
  Eigen::Vector3d lever_arm_body_m{0, 0, 0};  ///< from the track point: forward, left, up
};

enum class MissionState : std::uint8_t { planned, recording, finished };
inline constexpr auto k_mission_state_words =
    enum_table<MissionState>({{"planned", MissionState::planned},
                              {"recording", MissionState::recording},
                              {"finished", MissionState::finished}});

/// One flight, as the operator declares it.
struct Mission {
  MissionId id{};
  std::optional<SiteId> site{};
  std::string name;
  std::string kit;  ///< tag + receiver + aircraft; device profiles belong to it
  std::string radio;
  TrackFrame frame{TrackFrame::wgs84};
  TrackPoint point{TrackPoint::gnss_antenna};
  std::vector<TagAntenna> tags;
  MissionState state{MissionState::recording};
  UtcTime created{};
  std::optional<UtcTime> finished{};
};

}  // namespace anchord
