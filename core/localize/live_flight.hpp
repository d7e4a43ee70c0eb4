#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/geo/track_segments.hpp"
#include "core/localize/side_priors.hpp"
#include "core/types/estimate.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"
#include "core/types/range_model.hpp"

namespace anchord {

struct FlightSolution;

/// What became of one live range.
struct RangeResult {
  Range range;                         ///< as received, without its CIR
  std::optional<RangeModel> model{};   ///< what the promoted models said of it
  std::string refused;                 ///< reason word; empty when used
  std::optional<double> residual_m{};  ///< against the anchor's current estimate
  std::optional<double> sigma_m{};
  std::optional<double>
      corrected_m{};  ///< less what the model told, and the bias, curve and delay known by then
  std::optional<Eigen::Vector3d> tag_enu_m{};
  bool used() const { return refused.empty(); }
};

struct LiveOptions {
  FixClass min_fix{FixClass::rtk_fixed};
  double max_gap_s{0.5};            ///< between the two fixes round a range
  double max_wait_s{2.0};           ///< a range whose next fix has not come by then is told as refused
  double update_interval_s{0.5};    ///< per anchor, of measurement time: 2 Hz
  std::size_t max_rows{1500};       ///< per anchor; beyond it every second row goes, old and new alike
  std::size_t max_waiting{20'000};  ///< ranges waiting for a fix; the oldest leaves first
  std::size_t max_track{72'000};    ///< poses kept: an hour at 20 Hz; the oldest leaves first
  double range_sigma_m{0.15};       ///< of an uncorrected range
  double bias_prior_sigma_m{0.3};
  double lag_s{0.0};  ///< of the kit; adopt() replaces both
  double bias_m{0.0};
  std::size_t max_logged{
      12'000};          ///< ranges kept for when the track turns out to be another; then every second
  TrackLimits track{};  ///< what the positions are held against
  std::optional<Wgs84> origin{};  ///< of the site; absent: the first good fix, or the middle of the flight
                                  ///< once that one turned out to be no part of it
  std::map<NetworkId, AnchorPriors> priors{};  ///< set_priors() replaces them
};

/// One flight as it happens: joins ranges to the track and keeps every anchor's estimate warm.
///
/// Ranges and fixes may come in any order, all of one kind before the other too (an upload of two files does
/// that): a range whose time the track does not cover yet is told as refused once it is late, but stays
/// parked, and is used when the fixes come after all. Driven by measurement time only, so that a replay
/// repeats it at any speed. Memory is bounded by LiveOptions. Not thread-safe: one strand per mission owns
/// it.
class LiveFlight {
 public:
  explicit LiveFlight(Mission mission, LiveOptions options = {});
  ~LiveFlight();
  LiveFlight(LiveFlight&&) noexcept;
  LiveFlight& operator=(LiveFlight&&) noexcept;

  void add(const Fix& fix);
  /// `model`: its correction is taken off and its sigma used, before anything is solved.
  void add(const Range& range, const std::optional<RangeModel>& model = {});
  /// A range a person took out of use: counted as "excluded" and told, nothing else.
  void leave_out(const Range& range);
  /// What turns and height searches told, in metres of origin(): priors from the next solve on.
  void set_priors(std::map<NetworkId, AnchorPriors> priors);
  /// A joint solution of this flight's rows up to `cut`: its bias and lag hold from now on, and its positions
  /// are what later ranges refine. Solved in the frame of origin().
  void adopt(const FlightSolution& solution, UtcTime cut);
  /// While held, ranges are joined but nothing is solved: for reading in what was stored. Letting go solves
  /// every anchor once.
  void hold(bool held);
  /// Ends the stream: ranges that wait for a fix are told as refused (and stay parked, should it come after
  /// all), every anchor is solved once more.
  void finish();

  /// Decided since the last call, in order of decision.
  std::vector<RangeResult> take_ranges();
  /// Anchors solved since the last call, the newest answer of each.
  std::vector<Estimate> take_estimates();
  /// Newest answer of every anchor heard.
  std::vector<Estimate> estimates() const;
  /// How far an anchor stands from where the same ranges put it without the models. A mirror solution is as
  /// good as its twin: the nearest two places of both are compared.
  struct ModelShift {
    double m{};
    double known_to_m{};  ///< 95 %, horizontally and vertically together, of the place without the models
  };
  /// Nothing where no range of it was corrected.
  std::optional<ModelShift> model_shift(NetworkId anchor) const;
  /// Of the ENU numbers; none in a local frame or before the first good fix. Another one when the first
  /// positions turned out to be no part of the flight: every estimate is in the new one then.
  std::optional<Wgs84> origin() const;
  /// Positions that are no part of the track, reason -> count as it stands; "old_correction" counts as float.
  std::map<std::string, std::size_t> fixes_refused() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord
