#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/geo/track_segments.hpp"
#include "core/types/fix.hpp"

namespace anchord {

/// Why a position is no part of the track.
enum class FixRefusal : std::uint8_t {
  none,
  not_usable,    ///< no fix, not finite, beyond any place on Earth, another frame
  far_away,      ///< beyond TrackLimits::max_distance_m
  jump,          ///< no aircraft could have got there
  step,          ///< one of many in a row that are off together: another base, another ambiguity
  future_stamp,  ///< stamped ahead of those that came before and after it, or of the whole flight
  past_stamp,    ///< stamped before the whole flight
  out_of_order,  ///< stamped far behind those that came before and after it
};
/// The words under which they are counted.
inline constexpr auto k_fix_refusal_words =
    enum_table<FixRefusal>({{"none", FixRefusal::none},
                            {"not_usable", FixRefusal::not_usable},
                            {"far_from_flight", FixRefusal::far_away},
                            {"position_jump", FixRefusal::jump},
                            {"position_step", FixRefusal::step},
                            {"future_stamp", FixRefusal::future_stamp},
                            {"past_stamp", FixRefusal::past_stamp},
                            {"out_of_order", FixRefusal::out_of_order}});
constexpr std::string_view to_string(FixRefusal why) { return k_fix_refusal_words.word(why); }
/// Corrections were too old for its class; counted, and used as RTK float.
inline constexpr std::string_view k_old_correction = "old_correction";

/// The fix as far as it can be believed: with corrections older than the limit, RTK fixed counts as float.
Fix believed_class(const Fix& fix, const TrackLimits& limits);
/// A place on Earth (or within 1000 km in a local frame) with a fix.
bool usable(const Fix& fix, TrackFrame frame);
/// In axes that need no origin: ECEF, or the local frame itself.
Eigen::Vector3d fixed_place_m(const Fix& fix);
/// Of one axis, for telling a jump from noise: what the fix claims, but no more than five times its class.
double jump_sigma_m(const Fix& fix);
/// Of a part of a track that is not the flight. n_between: positions from its first to its last, of any part.
FixRefusal why_apart(const TrackSegments::Segment& part, const TrackSegments::Segment& flight,
                     double max_pause_s, std::size_t n_between);
/// The middle of many places: the median of each axis of the tangent plane. There must be one.
Wgs84 robust_centre(std::span<const Wgs84> places);

/// A track judged as a whole.
struct CheckedTrack {
  std::vector<Fix> fixes;                        ///< believed, ascending in time, old corrections as float
  std::vector<FixRefusal> refusals{};            ///< of each fix as it was given
  std::map<std::string, std::size_t> refused{};  ///< reason -> count; old_correction counts what was kept too
  std::optional<Wgs84> centre{};     ///< of the best class there is; absent in a local frame or without a fix
  double step_share{0};              ///< of the positions good enough: in parts that are off as a whole
  std::vector<std::string> notes{};  ///< for people: what was left out, since when, by how much
};

/// Judges positions against each other, in whatever order they come: usable, near the flight's middle,
/// stamped where their neighbours in arrival are, and within reach of those around them (TrackSegments). What
/// is off decides no origin and hides no other: the largest consistent part is the flight.
CheckedTrack check_track(std::span<const Fix> fixes, TrackFrame frame, FixClass min_fix,
                         const TrackLimits& limits = {});

}  // namespace anchord
