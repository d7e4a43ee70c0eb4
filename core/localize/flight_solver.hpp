#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/error_budget.hpp"
#include "core/localize/flight_options.hpp"
#include "core/localize/start_search.hpp"
#include "core/types/estimate.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {

/// A number with its one-sigma.
struct Valued {
  double value{};
  double sigma{};
};

/// What the whole kit shares: bias, range curve, lag, vertical antenna offset (see KitProfile).
struct SharedSolution {
  Valued bias_m;
  Valued curve_m;  ///< per e-fold of distance beyond 5 m
  Valued lag_s;    ///< the range stamped t belongs to the track at t + lag
  Valued lever_up_m;
  struct AntennaArm {
    NetworkId tag{};
    std::uint8_t antenna{0};
    Valued up_m;  ///< l_z of this antenna, on top of its declared arm
  };
  std::vector<AntennaArm> lever_up_by_antenna;  ///< each that was heard; lever_up_m is what they share
  std::optional<Valued> lever_forward_m, lever_left_m;  ///< on top of the declared arm, where asked for
  std::optional<double> lever_arm_sigma_m{};  ///< of the declared arm, as the regions hold it; absent: none
  /// The ranges are too long by this share of their length (systematic_error.hpp); nothing is corrected.
  Valued range_scale;
  double range_scale_z{};
  bool bias_determined{true};  ///< false: neither this flight nor a profile says what the bias is
  double bias_z{};             ///< |b| / sd(b) the calibrated-or-not gate saw
};

/// How the track stands to one anchor; lengths in metres.
struct GeometryMeasures {
  Eigen::Vector3d track_sd_m{0, 0, 0};  ///< standard deviations along the principal axes, ascending
  double median_range_m{};
  double line_ratio{};   ///< L2/D; small: the track is a line seen from the anchor
  double plane_ratio{};  ///< L1/D; small: the track is a plane, the anchor has a mirror solution
  double sigma_ratio{};  ///< largest horizontal semi-axis (1 sigma) over D
};

/// Which part of the position the flight determines.
enum class Determined : std::uint8_t { none, horizontal, position };
inline constexpr auto k_determined_words = enum_table<Determined>(
    {{"none", Determined::none}, {"horizontal", Determined::horizontal}, {"position", Determined::position}});

struct AnchorSolution {
  Estimate estimate;
  std::string name;  ///< id as the source wrote it
  Determined determined{Determined::none};
  GeometryMeasures geometry;
  Eigen::Matrix3d fit_covariance_m2{Eigen::Matrix3d::Zero()};  ///< before the floor was added
  std::optional<double> delay_m;                               ///< d_a: this unit against the kit
  std::optional<double> delay_sigma_m;
  double residual_scale_m{};            ///< robust, 1.4826 MAD
  std::optional<ErrorBudget> budget{};  ///< of the claimed covariance; absent without a position
  StartSearch search;
  std::vector<RangeResidual>
      residuals;  ///< of every range the track could place, by time; weight 0: rejected
};

/// One flight solved. Positions are ENU of `origin`, or the track's own local metres where that is absent.
struct FlightSolution {
  MissionId mission{};
  std::string name;
  std::optional<Wgs84> origin;
  SharedSolution shared;
  std::vector<AnchorSolution> anchors;               ///< in order of network id
  std::map<std::string, std::size_t> refused;        ///< over all anchors, reason -> count
  std::map<std::string, std::size_t> fixes_refused;  ///< reason -> count, of the positions
  std::size_t n_ranges{}, n_used{}, n_fixes{};
  bool placed{true};               ///< false: not one range is anywhere on the track; the first note says why
  std::vector<std::string> notes;  ///< for people: what limits this solution
};

/// Joint robust solution of every anchor heard in one flight, with the bias, lag and antenna offset they
/// share.
///
/// Model of range r stamped t:  r = |p(t+lag) + R (l + l_z e_z) - x_a| + b + d_a + c g(rho) + e,
/// g(rho) = ln(max(rho, 5 m) / 5 m). Tukey biweight with a scale from the residuals, priors on everything but
/// x_a, likelihood tempered because errors stay correlated for seconds. See core/localize/README.md.
///
/// flight   any order of rows; bad rows are refused with a reason and counted, never an error
/// errors   invalid_argument (options), too_few_observations (no track or no ranges at all), canceled
/// threads  pure; safe to call from any thread
Result<FlightSolution> solve_flight(const FlightData& flight, const FlightOptions& options = {});

/// Several flights of one kit: each takes what the others say about bias, curve, lag and offset as its prior.
/// Flights whose Mission::kit differs do not learn from each other. Answers in input order; `profile` gets
/// the profile of all flights when they are of one kit.
Result<std::vector<FlightSolution>> solve_flights(std::span<const FlightData* const> flights,
                                                  const FlightOptions& options = {},
                                                  KitProfile* profile = nullptr);

}  // namespace anchord
