#pragma once

#include <optional>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/local_frame.hpp"

namespace anchord {

/// Calibrations of the kits, every version kept. Callable from any thread; errors as in store.hpp.
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

/// Local frames by name. Updates name the version they change: conflict when it moved on.
class FrameStore {
 public:
  virtual ~FrameStore() = default;
  virtual Result<void> insert(const LocalFrame& frame) = 0;  ///< conflict when the name is taken
  virtual Result<void> update(const LocalFrame& frame, std::uint64_t expected_version) = 0;
  virtual Result<LocalFrame> frame(const FrameId& id) = 0;
  virtual Result<LocalFrame> frame(const std::string& name) = 0;
  virtual Result<std::vector<LocalFrame>> frames(std::size_t limit, const std::optional<FrameId>& after) = 0;
  virtual Result<std::vector<LocalFrame>> frames_of(const SiteId& site) = 0;  ///< oldest first
  virtual Result<void> remove(const FrameId& id, std::uint64_t expected_version) = 0;
};

}  // namespace anchord
