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

/// How well a lever arm may be said to be measured, one sigma: the one rule wherever it is read.
inline constexpr double k_least_lever_arm_sigma_m = 0.001, k_most_lever_arm_sigma_m = 10;
inline constexpr const char* k_lever_arm_sigma_rule = "must be 0.001 to 10 m, one sigma of the lever arm";
/// False of what is no number too.
constexpr bool is_lever_arm_sigma(double sigma_m) {
  return sigma_m >= k_least_lever_arm_sigma_m && sigma_m <= k_most_lever_arm_sigma_m;
}

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
  /// One sigma of the arms' forward and left part, as they were measured; absent: nobody says.
  std::optional<double> lever_arm_sigma_m{};
  MissionState state{MissionState::recording};
  UtcTime created{};
  std::optional<UtcTime> finished{};
};

}  // namespace anchord
