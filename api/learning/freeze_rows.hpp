#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "api/learning/dataset_table.hpp"

/// From measurements to rows that will not change any more. The service and the command line freeze alike:
/// the same rows and options give the same CSV and digest through both doors.
namespace anchord::api {

enum class Aggregation : std::uint8_t {
  none,
  mean,    ///< of each feature over the measurements of a setting (6.2.1), and from 3 on their spreads
  median,  ///< the same with medians
};
inline constexpr auto k_aggregation_words = enum_table<Aggregation>(
    {{"none", Aggregation::none}, {"mean", Aggregation::mean}, {"median", Aggregation::median}});

struct FreezeOptions {
  Aggregation aggregation{Aggregation::none};  ///< a live range is one ranging: so are the rows
  bool filter_faults{true};
  Place split_by{Place::environment};
  std::vector<std::string> test;  ///< names of places
  double test_share{0};           ///< or this share of the places, drawn by the seed
  std::uint64_t seed{1};
};

struct FrozenDataset {
  DatasetTable table;
  std::string report_json;
  std::size_t n_train{}, n_test{};
};

/// Drops faults, aggregates, splits by whole places, looks for leaks. `dropped`: what was left out before.
/// errors: too_few_observations (no row), not_found (a test place that is not there)
Result<FrozenDataset> freeze_rows(DatasetTable rows, const FreezeOptions& options,
                                  std::map<std::string, std::size_t> dropped);

/// The report as a few lines for people.
std::string split_report_text(const FrozenDataset& set);

/// A table whose rows say already which part they are in: what a CSV of frozen rows is.
FrozenDataset frozen_before(DatasetTable table);

}  // namespace anchord::api
