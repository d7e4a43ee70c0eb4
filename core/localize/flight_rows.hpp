#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/geo/tag_track.hpp"
#include "core/localize/flight_options.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {

/// One usable range, not yet joined to the track: where on it depends on the lag being sought.
struct JointRow {
  double t_s{};
  double distance_m{};
  Eigen::Vector3d lever_arm_body_m{0, 0, 0};
  NetworkId tag{};
  std::uint8_t antenna{0};
  /// Its antenna among those with a vertical arm of their own; absent: the common.
  std::optional<std::int8_t> arm{};
  const RangeErrorModel* error_model{};  ///< of the flight's; absent: no model spoke
  std::optional<double> rss_dbm{};
  double received_m{};  ///< as received; distance_m where no model has corrected that
};

/// One antenna of the aircraft that ranges came from.
struct FlightAntenna {
  NetworkId tag{};
  std::uint8_t antenna{0};
};

/// All ranges of one anchor, ascending in time.
struct AnchorRows {
  NetworkId id{};
  std::string name;
  std::vector<JointRow> rows;
  std::map<std::string, std::size_t> refused;
};

/// Ranges between two anchors, repeats made one: what stands still says the same thing again and again.
struct PairRow {
  std::size_t a{}, b{};  ///< indices into FlightRows::anchors
  double distance_m{};   ///< median
  double sigma_m{};      ///< FlightOptions::pair_sigma_m, or the repeats' spread where that is wider
  std::size_t n{};
};

/// A flight ready to be solved.
struct FlightRows {
  UtcTime epoch{};
  std::optional<EnuFrame> frame;  ///< absent: local metres
  TagTrack track;
  std::vector<AnchorRows> anchors;
  std::vector<PairRow> pairs;  ///< between anchors the tag heard too
  std::vector<std::string> notes;
  double track_span_s{};
  std::map<std::string, std::size_t> fixes_refused{};  ///< reason -> count
  std::vector<FlightAntenna> antennas{};               ///< those heard, by tag and antenna
  TrackPoint point{TrackPoint::body};                  ///< what the track is of
  double step_share{};  ///< of the good positions: in parts that are off as a whole (CheckedTrack)
};

/// Judges every row: positions against each other (check_track), ranges finite, within bounds, not a repeat,
/// of a declared tag. Refused ones are counted by reason. The origin is the one asked for, else the middle of
/// the positions believed. errors  too_few_observations: no usable fix or no range at all, or an origin
/// elsewhere
/// flight  outlives what is returned, which refers to its error models
Result<FlightRows> flight_rows(const FlightData& flight, const FlightOptions& options);
Result<FlightRows> flight_rows(FlightData&& flight, const FlightOptions& options) = delete;

}  // namespace anchord
