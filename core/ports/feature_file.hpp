#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/feature_table.hpp"

namespace anchord {

/// One table of features as a file that grows on the disk, for what does not fit into memory. One thread at a
/// time.
class FeatureFile {
 public:
  virtual ~FeatureFile() = default;
  /// Each with a value for each column. errors: storage_full, storage_unavailable
  virtual Result<void> add(std::span<const FeatureTable::Row> rows) = 0;
  /// The file is whole from then on. errors: as add
  virtual Result<void> finish() = 0;
};

/// Begins such a file, where none is yet; the rows of `head` are its first. errors: storage_full,
/// storage_unavailable
using MakeFeatureFile = std::function<Result<std::unique_ptr<FeatureFile>>(
    const std::filesystem::path& path, const FeatureTable& head, UtcTime now)>;

}  // namespace anchord
