#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/document.hpp"
#include "core/types/plan.hpp"

namespace anchord {

/// A plan as kept: the document is the service's own text, the store reads only what stands beside it.
struct StoredPlan {
  PlanId id{};
  std::string name;
  std::optional<SiteId> site{};
  Document document;  ///< api/planning/plan_json
  UtcTime created{}, changed{};
  std::uint64_t version{1};
};

/// Plans, newest first in lists. An update names the version it changes: conflict when it moved on; the
/// stored version becomes expected_version + 1.
class PlanStore {
 public:
  virtual ~PlanStore() = default;
  virtual Result<void> insert(const StoredPlan& plan) = 0;
  virtual Result<void> update(const StoredPlan& plan, std::uint64_t expected_version) = 0;
  virtual Result<StoredPlan> plan(const PlanId& id) = 0;
  virtual Result<std::vector<StoredPlan>> plans(std::size_t limit, const std::optional<PlanId>& after) = 0;
  virtual Result<void> remove(const PlanId& id, std::uint64_t expected_version) = 0;
  /// State of the procedure of a running mission (the service's own text), so that a restarted server knows
  /// what was being flown. Empty text forgets it.
  virtual Result<void> keep_procedure(const MissionId& mission, std::string_view state_json, UtcTime now) = 0;
  virtual Result<std::vector<std::pair<MissionId, std::string>>> procedures() = 0;
  /// Of one mission; empty where none is kept.
  virtual Result<std::string> procedure(const MissionId& mission) = 0;
};

}  // namespace anchord
