#pragma once

#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/ml/model.hpp"

/// Trained models as one portable JSON document: numbers and names, nothing executable (docs/learning.md,
/// "Model artifact").
namespace anchord::api {

inline constexpr std::string_view k_model_format = "anchord-model-1";
inline constexpr std::size_t k_max_artifact_bytes = std::size_t{64} << 20;

/// The same model gives the same bytes on every machine.
std::string write_model_artifact(const ml::Model& model);

/// The same, read back by read_model_artifact before anyone keeps it: nothing is written that cannot be read.
/// errors: those of read_model_artifact
Result<std::string> checked_model_artifact(const ml::Model& model);

/// Checks everything before it is used: size, nesting, finiteness, counts, index ranges, tree depth,
/// feature-set version. errors: bad_frame (not JSON, or a field that is wrong: its JSON pointer is named),
/// unsupported (format or feature-set version) threads  pure; never throws
Result<ml::Model> read_model_artifact(std::string_view json);

}  // namespace anchord::api
