#pragma once

#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/geo/enu.hpp"
#include "core/geo/tag_track.hpp"
#include "core/geo/track_check.hpp"

namespace anchord {

/// The track of a flight as it happens, judged as check_track judges a whole one: every position against
/// those that came before it, and all of them again when enough came out of order. The largest consistent
/// part is the flight; when another outgrows it (the first positions were wrong), the track is that one from
/// then on and the origin, unless it was given, its middle. Bounded; not thread-safe.
class LiveTrack {
 public:
  struct Options {
    FixClass min_fix{FixClass::rtk_fixed};
    std::size_t max_poses{72'000};
    std::optional<Wgs84> origin{};  ///< not used where the flight is beyond max_distance of it
    TrackLimits limits{};
  };
  /// What a position changed.
  struct Change {
    bool added{false};  ///< between from_s and to_s the track is another
    double from_s{}, to_s{};
    bool rebuilt{false};  ///< everything is another: poses, perhaps the origin
    bool believed{true};  ///< false: no aircraft could have been there, as far as is known by now
    /// The newest position, also of a part that is not the flight yet once it has three; in the frame.
    std::optional<TrackPose> newest{};
  };

  LiveTrack(TrackFrame kind, Options options);

  Change add(const Fix& fix);
  /// All positions once more, in the order of time; what the end of a stream asks for.
  Change settle();

  const std::deque<TrackPose>& poses() const { return poses_; }  ///< ascending in time
  const std::optional<EnuFrame>& frame() const { return frame_; }
  std::optional<UtcTime> epoch() const { return epoch_; }  ///< the instant of t_s = 0
  std::size_t n_used() const { return poses_.size(); }
  /// Reason -> count, as it stands. Looks at what changed since it was asked last.
  std::map<std::string, std::size_t> refused() const;

 private:
  /// Parts that are none: of a position not good enough to be held against others; of one whose stamp is too
  /// far from the flight's, or that came out of order and reaches nothing, until all are judged again.
  static constexpr std::size_t k_lesser = static_cast<std::size_t>(-1), k_apart = k_lesser - 1;
  struct Known {
    double t_s{};
    Eigen::Vector3d place_m{0, 0, 0};  ///< in axes without an origin
    double sigma_m{};
    std::size_t part{k_lesser};
    bool in_track{false};
  };
  /// Positions aside of one part, and why, once that was asked.
  struct Aside {
    std::size_t n{};
    std::optional<FixRefusal> why{};
  };

  Change process(const Fix& fix);
  std::size_t part_of(Known& known);
  Change insert(Known known, TrackPose pose);
  Change assess_again();
  Change take(std::size_t part);
  void choose_frame();
  bool reaches(const Known& known) const;
  void count_aside(const Known& known, bool more);
  void ask_again(std::size_t part, Aside& aside);
  /// A position came or went among those of other parts.
  void ask_those_about(double t_s);
  void count_all_aside();
  FixRefusal why_aside(std::size_t part) const;
  Eigen::Vector3d in_frame(const Eigen::Vector3d& place_m) const;
  double seconds(const Fix& fix) const { return seconds_between(*epoch_, fix.time); }

  TrackFrame kind_;
  Options options_;
  std::optional<EnuFrame> frame_;
  Eigen::Vector3d origin_m_{0, 0, 0};  ///< of frame_, in axes without an origin
  std::optional<UtcTime> epoch_;
  std::deque<TrackPose> poses_;
  std::map<double, TrackPose> aside_;  ///< of positions that are not in the track, by time
  std::deque<Known> all_;              ///< ascending in time
  std::vector<double> apart_s_;        ///< of those aside that are of no part
  // Those of a part are asked why when somebody wants to know and something about it has changed.
  mutable std::map<std::size_t, Aside> aside_parts_;
  mutable std::set<std::size_t> unasked_;
  mutable std::map<FixRefusal, std::size_t> asked_;  ///< how many, of parts that are not among those
  TrackSegments segments_;
  std::optional<std::size_t> flight_;  ///< the part that is the track
  double newest_s_{0};                 ///< of what segments_ was given
  bool origin_checked_{false};
  std::size_t unsorted_{0};     ///< positions that came out of order since all were judged
  std::optional<Fix> pending_;  ///< far ahead, until the next one says whether that is so
  std::map<std::string, std::size_t> counted_;
};

}  // namespace anchord
