#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/localize/flight_options.hpp"
#include "core/localize/flight_rows.hpp"
#include "core/localize/observation.hpp"
#include "core/localize/start_search.hpp"

namespace anchord {

/// Gaussian knowledge of the shared unknowns (order: kit_profile.hpp).
struct SharedPrior {
  SharedVector mean{SharedVector::Zero()};
  SharedMatrix information{SharedMatrix::Identity()};
};

/// Point in the space of all unknowns.
struct JointState {
  SharedVector shared{SharedVector::Zero()};
  struct Anchor {
    Eigen::Vector3d position_m{0, 0, 0};
    double delay_m{0};
    bool active{true};  ///< false: too few usable ranges, takes no part
  };
  std::vector<Anchor> anchors;
};

/// Priors of an anchor beside its ranges; none where none were given.
AnchorPriors priors_of(NetworkId id, const FlightOptions& options);

/// Levels received from an anchor, thinned to at most 400; empty without attitude or options.level_sigma_db.
std::vector<LevelSample> levels_of(const FlightRows& flight, const AnchorRows& anchor,
                                   const SharedVector& shared, const FlightOptions& options);

/// g(rho) of the model: no curve within 5 m, where it could not be told from the bias.
double range_curve(double distance_m);

/// Where the antenna of a row was: the track point with the declared arm, then what the shared unknowns add.
Eigen::Vector3d antenna_of(const TagPoint& point, const JointRow& row, const SharedVector& shared);

/// One row linearised: residual and derivative of the prediction by (x, y, z, d) and by the shared unknowns.
struct JointLine {
  TrackRefusal refused{TrackRefusal::none};
  double residual_m{};
  Eigen::Vector3d antenna_m{0, 0, 0};  ///< where the tag antenna was
  Eigen::Vector4d by_anchor{Eigen::Vector4d::Zero()};
  SharedVector by_shared{SharedVector::Zero()};
  double position_variance_m2{};  ///< of the track along the line of sight
};
JointLine linearise(const TagTrack& track, const JointRow& row, const SharedVector& shared,
                    const JointState::Anchor& anchor);

/// Robust weight, 0..1, of a residual against its scale, by the loss of the options.
double robust_weight(double residual_over_scale, const FlightOptions& options);

/// Normal equations of one round in the shape they have: an arrow. Robust weights and tempering are inside.
struct AnchorBlock {
  Eigen::Matrix4d own{Eigen::Matrix4d::Zero()};  ///< (x, d) against itself, prior on d included
  Eigen::Matrix<double, 4, k_shared_size> shared{
      Eigen::Matrix<double, 4, k_shared_size>::Zero()};  ///< (x, d) against the shared
  Eigen::Vector4d gradient{Eigen::Vector4d::Zero()};
  Eigen::Matrix4d own_inverse{Eigen::Matrix4d::Zero()};
  double scale_m{};      ///< 1.4826 MAD, never below the floor
  double white_share{};  ///< of the residual variance, what changes from one kept range to the next
  double kappa{1};       ///< tempering
  double sum_weight{};
  double rms_m{};                       ///< weighted
  double usual_position_variance_m2{};  ///< median over the rows, along the line of sight
  std::size_t n_used{}, n_in_track{}, n_rejected{};
  std::map<std::string, std::size_t> refused;  ///< by the track, and as outliers
  double last_t_s{};
};
struct JointNormal {
  std::vector<AnchorBlock> anchors;
  SharedMatrix shared{SharedMatrix::Zero()};  ///< of the likelihood alone, before elimination
  SharedVector shared_gradient{SharedVector::Zero()};
  SharedMatrix reduced{SharedMatrix::Zero()};  ///< Schur complement over x and d, without the prior
  SharedVector reduced_gradient{SharedVector::Zero()};
};
/// scales_from  residual scales to keep instead of measuring them anew
/// claims       rows with an error model count what may be claimed of them, not what makes the next step safe
JointNormal build_normal(const FlightRows& flight, const JointState& state, const FlightOptions& options,
                         double scale_floor_m, const JointNormal* scales_from = nullptr, bool claims = false);

/// The whole normal equations, 4 rows for each anchor in order, then the shared: what ranges between anchors
/// couple no longer has the shape of an arrow. Prior on the shared included.
struct DenseNormal {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd gradient;
};
DenseNormal dense_normal(const FlightRows& flight, const JointState& state, const JointNormal& normal,
                         const SharedPrior& prior, const FlightOptions& options);

/// Answer of the iteration.
struct JointFit {
  JointState state;
  JointNormal normal;  ///< at the state
  SharedMatrix shared_covariance{SharedMatrix::Zero()};
  std::vector<Eigen::Matrix4d> anchor_covariance;    ///< (x, d) of each anchor, everything else marginalised
  std::vector<Eigen::Matrix3d> arm_covariance_m2{};  ///< of that, by the declared sigma of the lever arm
  int rounds{};
  bool converged{false};
};
/// Iterated reweighted Gauss-Newton from a start. errors: canceled
Result<JointFit> solve_joint(const FlightRows& flight, const JointState& start, const SharedPrior& prior,
                             const FlightOptions& options);

/// The same minimum by Ceres, positions and delays eliminated first (Schur), Levenberg-Marquardt or dogleg.
/// settled  set: the last round of scales moved nothing any more
/// scales_from  residual scales to keep instead of measuring them anew
/// errors: canceled, no_convergence
Result<JointState> polish_joint_ceres(const FlightRows& flight, JointState state, const SharedPrior& prior,
                                      const FlightOptions& options, bool& settled,
                                      const JointNormal* scales_from = nullptr);

/// Start of every anchor by itself: closed form, reflections and a ring, each polished robustly, the best
/// kept. An anchor without a place has too few rows and takes no part.
struct JointStart {
  JointState state;
  std::vector<StartSearch> searches;  ///< one for each anchor
};
JointStart joint_start(const FlightRows& flight, const SharedPrior& prior, const FlightOptions& options);

/// Rows of one anchor at given shared values, thinned to at most `most`, with the range curve and bias taken
/// off.
std::vector<Observation> observations_of(const FlightRows& flight, const AnchorRows& anchor,
                                         const SharedVector& shared, std::size_t most, double sigma_m);

}  // namespace anchord
