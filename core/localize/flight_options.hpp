#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/geo/track_segments.hpp"
#include "core/localize/kit_profile.hpp"
#include "core/localize/side_priors.hpp"
#include "core/localize/solver_options.hpp"
#include "core/types/fix.hpp"

namespace anchord {

/// Range errors of a moving radio stay alike so long: two of these times are one independent look. On the
/// real flights 0.6 to 29 s, by the autocorrelation of their residuals.
inline constexpr double k_error_correlation_s = 7.5;

/// Settings of solve_flight. Defaults hold for every kit and place; their reasons were measured on real
/// flights (core/localize/README.md).
struct FlightOptions {
  Dims dims{Dims::three};
  Method method{Method::gauss_newton};
  Weights weights{Weights::inverse_variance};
  Loss loss{Loss::tukey};
  /// Dims two only: height of all anchors, ellipsoidal where the track is global, else z of its local frame;
  /// absent: mean height of the track.
  std::optional<double> anchor_height_m{};
  double anchor_height_sigma_m{0.1};  ///< of that height as it was stated: a tape, a plan
  /// Dims three: about where all anchors are that have no height among their priors, such as the poles they
  /// stand on; same reference.
  struct HeightPrior {
    double height_m{}, sigma_m{1.0};
  };
  std::optional<HeightPrior> height_prior{};

  FixClass min_fix{FixClass::rtk_fixed};  ///< both neighbours of a range must be at least this
  TrackLimits track{};                    ///< what the positions are held against
  std::optional<double> max_gap_s{};      ///< longest track interval; absent: interpolation error up to 0.5 m
  double min_range_m{0.05};               ///< reliability limit; 0 is the radios' failure value
  double max_range_m{150.0};

  double bias_prior_m{1.0};               ///< 0 to 0.7 m seen for whole kits
  double calibrated_bias_prior_m{0.025};  ///< once the gate says the kit is calibrated
  double bias_gate_z{3.0};                ///< below: calibrated
  double bias_known_sigma_m{
      0.1};  ///< a flight (with profile) that knows its bias worse than this cannot tell
  double unknown_bias_prior_m{0.28};  ///< then: between calibrated (0) and not (0.7), and the regions show it
  double delay_prior_m{0.06};         ///< unit to unit; a free one is fatal in small volumes
  double curve_prior_m{0.03};         ///< leading edge moves with received power
  double lag_prior_s{0.2};            ///< stamping delay
  double lever_prior_m{0.1};          ///< body z only: x, y are confounded with the lag
  double lever_across_prior_m{0};     ///< body x and y; 0: held at the declared arm. Only where heading and
                                      ///< course differ can it be told from the lag
  /// One sigma of the declared arm's forward and left part, as it was measured; the regions then hold it.
  /// Absent: what each flight's mission declares; where that is nothing either, anchors that a wrong arm
  /// would move unseen are held back (unseen_arm.hpp).
  std::optional<double> lever_arm_sigma_m{};
  double pair_sigma_m{0.1};              ///< of a range between two anchors, whatever its repeats say
  double pair_bias_prior_m{0.3};         ///< common to all ranges between anchors
  std::optional<double> fixed_bias_m{};  ///< no estimate: this bias is given

  double mad_factor{0.6};  ///< Tukey cut-off = 4.685 x this x scale; below 1 is what late clusters need
  double min_scale_m{0.02};
  double correlation_s{k_error_correlation_s};  ///< tempers the likelihood
  double floor_sigma_m{0.04};                   ///< per axis: frame, lever arm; no residual shows it

  std::map<NetworkId, AnchorPriors> priors{};  ///< which side an anchor is on, beside its ranges
  std::vector<Eigen::Vector2d>
      outline_m{};              ///< of the building, in the frame of the answers: anchors are inside
  double outline_sigma_m{1.0};  ///< of that; walls are thick and outlines drawn by hand
  std::map<NetworkId, Eigen::Vector3d>
      starts{};                 ///< where to begin, in place of the search; the prior knows nothing of it
  bool start_at_priors{false};  ///< begin where bearing and height of the priors meet, where both are known
  std::optional<double> level_sigma_db{};  ///< of RSS about the turn profile; absent: RSS is no prior

  std::optional<Wgs84> origin{};  ///< of the ENU answers; absent: the middle of the positions believed
  std::optional<KitProfile> profile{};
  std::function<bool()> canceled{};  ///< asked between rounds
  Result<void> check() const;
};

}  // namespace anchord
