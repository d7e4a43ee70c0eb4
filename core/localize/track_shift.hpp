#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"
#include "core/types/fix.hpp"

namespace anchord {

/// Where all that follows in a track may be off what went before by one constant shift: RTK came back with
/// another ambiguity, or with a base that was set up anew.
struct TrackBreak {
  enum class Kind : std::uint8_t { gap, corrections, jump };
  Kind kind{Kind::gap};  ///< no good position; corrections out of date; a step that no motion explains
  double from_s{};       ///< last good position before
  double to_s{};         ///< first good position after
};

/// Breaks of a track, ascending: gaps of more than a second, or in which a position was below min_fix;
/// corrections older than ten seconds that became new again; steps of 0.2 m and more between two positions
/// that the velocities on both sides do not explain. Breaks close to each other are one: at most 24. fixes as
/// they came, in any order; asked for the age of their corrections alone
std::vector<TrackBreak> track_breaks(const FlightRows& flight, std::span<const Fix> fixes, FixClass min_fix);

/// What the ranges of all anchors together say about shifts of the track at its breaks.
struct TrackShift {
  Gate gate;                                     ///< "track_shift", of the whole flight
  std::vector<Eigen::Matrix3d> covariance_m2{};  ///< what the region of each anchor is to hold for it beside
  std::optional<std::string> note{};             ///< which shift would not be seen, where that matters
};

/// Is a part of the track off the rest as a whole? For every break the shift of all that follows, and for
/// every part between two breaks that of the part alone, joins the unknowns of the fit, in its tempered
/// weights, so that errors which stay alike for seconds count as they do there. The oddest eight are solved
/// for again with everything else: the misfit of a shift hides in the residual scale, and its ranges are what
/// the fit takes for outliers. The gate fails at 99 % by the number of shifts asked. Parts shorter than two
/// correlation times are not asked: an error that lasts as long is a shift to this test (a real flight has
/// 0.3 m so in its last ten seconds).
///
/// A shift that the ranges cannot exclude is in the regions: before the ranges one flight with breaks in
/// twenty has a shift of 1 m (one sigma of each axis), after them as many as they leave (Bayes factor of the
/// shift); where they come near to showing one, more. The longer part of the flight is likelier the right
/// one.
///
/// Of 72 made anchors, track shifted in height from its one gap on by 0.5, 1, 2 m, wrong by more than 1.3
/// regions and accepted: none (before: 21, 33, 27); 70 accepted without a shift, as before, with the same
/// regions.
///
/// returns  nothing without breaks
std::optional<TrackShift> check_track_shift(const FlightRows& flight, std::span<const TrackBreak> breaks,
                                            const JointFit& fit, const SharedPrior& prior,
                                            const FlightOptions& options);

}  // namespace anchord
