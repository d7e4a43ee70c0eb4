#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/local_frame.hpp"

namespace anchord {

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
