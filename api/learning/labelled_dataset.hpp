#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "api/formats/labelled_table.hpp"
#include "core/base/result.hpp"
#include "core/ml/dataset.hpp"

namespace anchord::api {

struct DatasetTable;

/// A data set of the named features (computed ones by their name, others as columns of the file); rows that
/// lack one, or a label or truth that is asked for, are left out and counted in `dropped`, feature by
/// feature. Without `need_truth` the set has a bias only where all of its rows have a true range. `rows`
/// receives the table's row of each of the set's. errors: not_found (feature, label or truth column),
/// too_few_observations (says what the rows lack)
struct SetRequest {
  std::vector<std::string> features{};
  bool need_label{}, need_truth{};
};
Result<ml::Dataset> dataset_from(const LabelledTable& table, const SetRequest& request,
                                 std::vector<std::size_t>& rows, Dropped& dropped);

/// Every row with all its features and registers, not yet frozen: its place is the environment, its placement
/// the setting. campaign  empty: the name of its file
DatasetTable dataset_rows(const LabelledTable& table, const std::string& campaign = {});

/// Names every row (but at most 1 %) has: computed features, then the register columns that are features in
/// their own right. `lacking`: what some have and more than that lack, with the rows without it.
std::vector<std::string> available_features(const LabelledTable& table, bool with_registers,
                                            std::map<std::string, std::size_t>& lacking);

}  // namespace anchord::api
