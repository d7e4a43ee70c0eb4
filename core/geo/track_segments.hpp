#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <vector>

namespace anchord {

/// What an aircraft round a building can do, and what a stream of its positions may be like.
struct TrackLimits {
  double max_speed_mps{30};          ///< three times what is flown
  double max_acceleration_mps2{15};  ///< 1.5 g; real flights and walks of four kits stay below
  double max_correction_age_s{30};   ///< beyond, RTK fixed counts as float; RTKLIB's own limit
  double max_pause_s{7200};          ///< stamps further apart are not of one flight
  double max_ahead_s{10};            ///< of a stamp that the next ones do not confirm
  double max_disorder_s{600};        ///< a gateway may hold rows back for ten minutes
  double max_distance_m{20'000};     ///< from the middle of the flight
  double max_step_share{0.05};  ///< of the positions, in a part that is off as a whole: more fails a gate
};

/// Sorts positions, ascending in time, into pieces within which an aircraft can have moved: a position that
/// no piece can reach begins a new one. An outlier is a piece of one, a base that moved in flight makes two
/// long ones, and a track that left a piece for some outliers comes back to it.
///
/// A piece is reached when the position is within max_speed, and within max_acceleration of where the piece's
/// velocity leads; of several the likeliest is taken (allowance, deviation, and how many positions it had in
/// the last seconds). A piece that just began takes the velocity of the one it left. On the clean tracks of
/// outdoor RTK, motion capture and odometry there is one piece; 5 % jumps of 1 to 50 m are all found at 8 Hz.
/// Not thread-safe.
class TrackSegments {
 public:
  struct Segment {
    std::size_t n{};
    double first_s{}, last_s{};
  };
  explicit TrackSegments(const TrackLimits& limits = {}) : limits_(limits) {}

  /// Index of the piece. t_s not before any earlier one; at_m in any Cartesian frame; sigma_m of one axis.
  std::size_t add(double t_s, const Eigen::Vector3d& at_m, double sigma_m);
  std::size_t size() const { return pieces_.size(); }
  const Segment& segment(std::size_t index) const { return pieces_[index].told; }
  /// The one with most positions, the first of equals. There must be one.
  std::size_t largest() const { return largest_; }

 private:
  struct Place {
    double t_s{};
    Eigen::Vector3d at_m{0, 0, 0};
    double sigma_m{};
  };
  struct Velocity {
    double over_s{};
    Eigen::Vector3d mps{0, 0, 0};
  };
  struct Piece {
    Segment told;
    std::deque<Place> recent;           ///< of the last seconds, the newest last; never empty
    std::optional<Velocity> inherited;  ///< of the piece that was left
  };

  std::optional<Velocity> velocity(const Piece& piece) const;
  std::optional<double> cost(const Piece& piece, const Place& place) const;
  std::size_t begin(const Place& place);

  TrackLimits limits_;
  std::vector<Piece> pieces_;
  std::vector<std::size_t> open_;  ///< those still looked at
  std::size_t largest_{0};
};

}  // namespace anchord
