#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/base/ids.hpp"
#include "core/localize/turn.hpp"
#include "core/procedure/height_search.hpp"

namespace anchord::procedure {

/// What a turn and a height search told of one anchor (8.3.5, 8.3.6) before its position is known.
struct Priors {
  std::vector<TurnSample> turn;
  std::vector<HeightSample> heights;
  std::optional<Bearing> bearing{};
  std::optional<HeightGuess> height{};
  std::optional<Eigen::Vector3d> turned_at_m{}, climbed_at_m{};  ///< where bearing and height were found
  std::optional<Eigen::Vector3d> guess_m{};  ///< eq 8.7 from the newest range; needs the bearing
};

/// Collects RSS while the aircraft turns and climbs and concludes when it has. Metres of the plan's origin.
/// Bounded: at most 2 000 samples of a kind for each anchor. Not thread-safe.
class PriorBook {
 public:
  /// `default_height_m`: of the first guess where no height search gave one.
  explicit PriorBook(double default_height_m) : default_height_m_(default_height_m) {}

  void turned(NetworkId anchor, double heading_rad, double rss_dbm);
  void climbed(NetworkId anchor, double height_m, double rss_dbm);
  /// Newest range of an anchor, and where the tag was.
  void ranged(NetworkId anchor, const Eigen::Vector3d& tag_m, double distance_m);
  void begin_turn();           ///< forgets the samples of the last one
  void begin_height_search();  ///< likewise
  /// Anchors whose samples say something get a bearing, or a height; the others keep what they had.
  void conclude_turn();
  void conclude_height_search();
  /// Whether the turn's samples show a lobe of it; none: there are too few to say.
  std::optional<bool> lobe_seen(NetworkId anchor) const;

  const std::map<NetworkId, Priors>& priors() const { return priors_; }
  std::optional<Eigen::Vector3d> guess_m(NetworkId anchor) const;
  /// Grows whenever a turn or a height search was concluded.
  std::uint64_t version() const { return version_; }

 private:
  struct Seen {
    Eigen::Vector3d tag_m{0, 0, 0};
    double distance_m{};
  };
  void guess(NetworkId anchor, Priors& priors);

  double default_height_m_;
  std::uint64_t version_{0};
  std::map<NetworkId, Priors> priors_;
  std::map<NetworkId, Seen> newest_;
};

}  // namespace anchord::procedure
