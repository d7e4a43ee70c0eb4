#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/result.hpp"

/// Labelled samples ready for training: every feature present and finite in every row.
namespace anchord::ml {

struct Dataset {
  std::vector<std::string> features{};     ///< names, in column order
  std::vector<double> x{};                 ///< rows() x features.size(), row after row
  std::vector<std::uint8_t> los{};         ///< 1 LOS, 0 NLOS; empty when unlabelled
  std::vector<double> bias_m{};            ///< measured - true range (eq 6.3); empty without truth
  std::vector<double> weight{};            ///< > 0
  std::vector<std::uint32_t> group{};      ///< place, room, campaign: never divided by a split
  std::vector<std::uint32_t> placement{};  ///< repeats of one placement are near copies of each other
  std::vector<std::string> group_names{};

  std::size_t rows() const { return weight.size(); }
  std::size_t columns() const { return features.size(); }
  std::span<const double> row(std::size_t i) const { return {x.data() + i * columns(), columns()}; }
  bool labelled() const { return !los.empty(); }
  bool has_truth() const { return !bias_m.empty(); }

  /// The rows in the order given.
  Dataset subset(std::span<const std::size_t> rows) const;
  /// The features named, in that order. errors: not_found
  Result<Dataset> with_features(std::span<const std::string> names) const;
  /// Rows of one class.
  Dataset of_class(bool is_los) const;
  /// SHA-256 over names, values, labels, truths and groups: the same data give the same digest on every
  /// machine.
  std::string digest() const;
};

/// Repeats whose range lies more than `mads` (1.4826 MAD) and `floor_m` off their placement's median; needs 5
/// repeats to judge.
std::vector<std::size_t> range_outliers(std::span<const double> range_m,
                                        std::span<const std::uint32_t> placement, double mads = 8,
                                        double floor_m = 0.5);

/// Rows whose truth is known worse weigh less: by s^2 / (s^2 + sigma^2), s the scatter of the biases of their
/// class, which no truth explains; each class keeps its mean weight. No sigma: the truth counts as exact.
void weigh_by_truth(Dataset& data, std::span<const std::optional<double>> truth_sigma_m);

/// One row per placement: the median (or the mean, as 6.2.1 does) of each feature and of the bias; class by
/// majority; weight of its first row.
Dataset aggregate_placements(const Dataset& data, bool mean = false);

/// Name of a place, or its number where it has none.
std::string place_name(const Dataset& data, std::uint32_t group);

/// At most `per_placement` rows of each placement, evenly spread over it, each weighing its own weight /
/// their number: every placement counts alike.
Dataset thin_placements(const Dataset& data, std::size_t per_placement);

/// Fold 0..k-1 of each row: whole groups, shuffled by the seed, largest first into the lightest fold. Fewer
/// groups than k: one fold each.
std::vector<std::size_t> grouped_folds(std::span<const std::uint32_t> group, std::size_t k,
                                       std::uint64_t seed);

/// Rows in (true) or outside (false) a fold.
std::vector<std::size_t> rows_of_fold(std::span<const std::size_t> fold, std::size_t which, bool inside);

std::size_t count_distinct(std::span<const std::uint32_t> ids);

}  // namespace anchord::ml
