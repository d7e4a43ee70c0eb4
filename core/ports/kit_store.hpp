#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/local_frame.hpp"

namespace anchord {

/// Calibrations of the kits, every version kept. Callable from any thread; errors as in
/// measurement_store.hpp.
class KitStore {
 public:
  virtual ~KitStore() = default;
  /// The one in use; nothing for a kit without one.
  virtual Result<std::optional<StoredProfile>> profile(const std::string& kit) = 0;
  /// Becomes version expected_version + 1 (0: the first). conflict when another one came in between.
  virtual Result<StoredProfile> put(StoredProfile profile, std::uint64_t expected_version) = 0;
  virtual Result<std::vector<StoredProfile>> history(const std::string& kit, std::size_t limit) = 0;
  virtual Result<std::vector<StoredProfile>> newest() = 0;  ///< of every kit, by name
};

}  // namespace anchord
