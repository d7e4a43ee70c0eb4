#include "server/gateway/disk_debt.hpp"

#include <utility>

namespace anchord::gateway {

bool DiskDebt::hold(std::vector<Batch> batches, std::uint64_t max_bytes) {
  std::uint64_t bytes = 0;
  for (const auto& batch : batches) bytes += weight(batch);
  if (held_bytes_ + bytes > max_bytes) return false;
  held_bytes_ += bytes;
  for (auto& batch : batches) {
    held_rows_ += batch.n_rows;
    const auto id = batch.id;
    held_.emplace(id, std::make_shared<const Batch>(std::move(batch)));
  }
  return true;
}

std::optional<std::uint64_t> DiskDebt::release(std::int64_t id) {
  const auto at = held_.find(id);
  if (at == held_.end()) return std::nullopt;
  const std::uint64_t rows = at->second->n_rows;
  held_rows_ -= rows;
  held_bytes_ -= weight(*at->second);
  held_.erase(at);
  return rows;
}

void DiskDebt::stored() {
  held_.clear();
  held_rows_ = held_bytes_ = 0;
}

std::uint64_t DiskDebt::assign(const MissionId& mission) {
  std::uint64_t rows = 0;
  for (auto& [id, batch] : held_) {
    if (batch->mission != unassigned()) continue;
    auto assigned = *batch;
    assigned.mission = mission;
    rows += assigned.n_rows;
    batch = std::make_shared<const Batch>(std::move(assigned));
  }
  return rows;
}

}  // namespace anchord::gateway
