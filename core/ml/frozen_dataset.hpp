#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/ml/training.hpp"

/// A data set that will not change any more: what a training run names, so that it can be run again.
namespace anchord::ml {

enum class Aggregation : std::uint8_t {
  none,    ///< every ranging
  mean,    ///< of each measurement point (6.2.1)
  median,  ///< of each measurement point: single outliers do not move it
};
std::string_view aggregation_name(Aggregation aggregation);
std::optional<Aggregation> aggregation_of(std::string_view name);

struct FreezeOptions {
  Aggregation aggregation{Aggregation::mean};
  std::vector<std::string> test_places{};  ///< held out for the final test
  double test_share{0};                    ///< or this share of the places, drawn by the seed
  std::uint64_t seed{1};
};

struct FrozenDataset {
  Dataset data{};
  Aggregation aggregation{};
  std::vector<std::string> test_places{};
  SplitReport split{};
  std::string digest{};  ///< over data, aggregation and split

  bool in_test(std::size_t row) const;
};

/// Aggregates, splits by whole places, looks for leaks, takes the digest.
/// errors  not_found (a place that is not there), too_few_observations (nothing left to train on)
Result<FrozenDataset> freeze(const Dataset& data, const FreezeOptions& options);

/// The same of rows that were aggregated before: how a data set read from a file is frozen again.
Result<FrozenDataset> freeze_as(Dataset data, Aggregation was, const std::vector<std::string>& test_places);

}  // namespace anchord::ml
