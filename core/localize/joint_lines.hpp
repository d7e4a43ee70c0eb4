#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/localize/joint_model.hpp"

namespace anchord {

/// The rows of one anchor as linearise() has each of them, every number of theirs side by side, so that the
/// arithmetic is on four rows at a time. The order of all operations is fixed, whatever registers a machine
/// has.
class JointLines {
 public:
  /// The derivatives by bias and delay are 1; an antenna's own arm is seen as the common one is. antenna_:
  /// where it was, metres.
  enum Column : std::size_t {
    x,
    y,
    z,
    curve,
    lag,
    lever,
    forward,
    left,
    residual,
    variance,
    antenna_x,
    antenna_y,
    antenna_z,
    stamp,  ///< of the row, seconds
    n_columns
  };

  JointLines(const TagTrack& track, std::span<const JointRow> rows, const SharedVector& shared,
             const JointState::Anchor& anchor);

  std::size_t size() const { return rows_.size(); }
  /// Those that the track has a place for, in their order.
  std::span<const JointRow* const> rows() const { return rows_; }
  std::span<const double> of(Column column) const { return {begin(column), size()}; }
  std::span<double> of(Column column) { return {values_.get() + column * padded_, size()}; }
  /// All of them: without attitude, by which `forward` and `left` are nothing; of antennas without an arm of
  /// their own, or with the same; of one antenna of one tag; without an error model.
  bool level() const { return level_; }
  bool one_arm() const { return one_arm_; }
  bool one_antenna() const { return one_antenna_; }
  bool without_models() const { return without_models_; }
  /// One of them as linearise() gives it.
  JointLine line(std::size_t i) const;
  /// The others by TrackRefusal.
  const std::array<std::size_t, 4>& refused() const { return refused_; }
  /// As many as there are rows in whole groups of four.
  std::size_t padded() const { return padded_; }
  const double* begin(Column column) const { return values_.get() + column * padded_; }

 private:
  std::vector<const JointRow*> rows_;
  std::size_t padded_{};
  std::unique_ptr<double[]> values_;
  std::array<std::size_t, 4> refused_{};
  bool level_{true}, one_arm_{true}, one_antenna_{true}, without_models_{true};
};

/// Weights by Tukey's loss of rows without an error model.
/// variance_m2  that residuals are held against
/// usual_m2     variance of the track that is in it
/// cut_off      sigmas from where on a row weighs nothing
std::vector<double> tukey_weights(const JointLines& lines, double variance_m2, double usual_m2,
                                  double cut_off);

/// Weighted sums of the products of columns two by two: a symmetric matrix.
/// columns  each as long as the weights, whole groups of four
std::vector<double> weighted_products(std::span<const double* const> columns,
                                      std::span<const double> weights);

/// Adds the weighted sums of products of the lines to the blocks.
/// weights  one for each row, all times `unit`
void add_lines(const JointLines& lines, std::span<const double> weights, double unit, AnchorBlock& block,
               JointNormal& normal);

}  // namespace anchord
