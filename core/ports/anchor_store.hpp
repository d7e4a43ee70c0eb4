#pragma once

#include <optional>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/anchor.hpp"

namespace anchord {

/// Anchors and what facility tools say of them, in id order; their positions are in revisions. Updates name
/// the version they change, as those of sites.
class AnchorStore {
 public:
  virtual ~AnchorStore() = default;
  virtual Result<Anchor> find_or_create(NetworkId network_id, UtcTime now) = 0;
  virtual Result<void> update(const Anchor& anchor, std::uint64_t expected_version) = 0;
  virtual Result<Anchor> anchor(const AnchorId& id) = 0;
  virtual Result<Anchor> anchor(NetworkId network_id) = 0;
  virtual Result<std::vector<Anchor>> anchors(std::size_t limit, const std::optional<AnchorId>& after) = 0;
};

}  // namespace anchord
