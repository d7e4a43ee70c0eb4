#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "api/learning/dataset_table.hpp"

namespace anchord::api {

/// A row's features and true distance, without its place or name: what two copies of one have in common.
std::vector<double> numbers_of(const DatasetRow& row);

/// Of all rows of the training part.
std::set<std::vector<double>> trained_numbers(const DatasetTable& table);

/// Rows of the test part that stand in the training part too, number by number.
std::size_t copies(const DatasetTable& table);

}  // namespace anchord::api
