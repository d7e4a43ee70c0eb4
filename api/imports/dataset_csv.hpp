#pragma once

#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/ml/frozen_dataset.hpp"

/// A frozen data set as CSV (docs/learning.md, "Data sets"): one row a line, numbers in their shortest exact
/// form, so that it is read back to the same digest.
namespace anchord::api {

inline constexpr std::string_view k_dataset_format = "anchord-dataset-1";

/// First line `# anchord-dataset-1 aggregation=mean digest=...`, then
/// place,place_id,placement_id,test,weight[,los][,bias_m],features...
std::string write_dataset_csv(const ml::FrozenDataset& set);

/// True where the text begins as `write_dataset_csv` does.
bool is_dataset_csv(std::string_view text);

/// errors  bad_frame (not this format, a line that is torn or holds no number: the line is named),
///         checksum_mismatch (the content is not what the digest in the first line says)
Result<ml::FrozenDataset> read_dataset_csv(std::string_view text);

}  // namespace anchord::api
