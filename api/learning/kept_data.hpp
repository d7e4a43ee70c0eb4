#pragma once

#include <optional>
#include <string>
#include <vector>

#include "api/learning/dataset_table.hpp"
#include "core/ml/model.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord::api {

/// Rows this server keeps that can judge a model from elsewhere.
struct KeptData {
  DatasetTable table;              ///< every row counts as held out
  std::vector<std::string> names;  ///< of the data sets they are of
};

/// Held-out places of every frozen data set (the newest 20, at most 50 000 rows), and all rows of one that
/// has none held out, unless the model says it was trained on that very data: its digest is in the manifest.
/// Whose rows the model's task or features cannot use are left out when it is measured.
Result<KeptData> kept_data(DatasetStore& datasets, const ml::Model& model);

}  // namespace anchord::api
