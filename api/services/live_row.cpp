#include "api/services/live_row.hpp"

#include <functional>

namespace anchord::api {
namespace {

constexpr double k_least_range_m = 0.05;  // what radios report for a failure lies below it

}  // namespace

UtcTime time_of(const LiveRow& row) {
  return std::visit([](const auto& r) { return r.time; }, row);
}

std::size_t identity(const LiveRow& row) {
  const auto mix = [](std::size_t seed, std::uint64_t value) {
    return seed ^ (std::hash<std::uint64_t>{}(value) + 0x9e3779b97f4a7c15ULL + (seed << 6) + (seed >> 2));
  };
  std::size_t hash = mix(row.index(), static_cast<std::uint64_t>(time_of(row).ns));
  if (const auto* judged = std::get_if<JudgedRange>(&row)) {
    const Range& range = judged->range;
    hash = mix(mix(hash, range.tag.value), range.anchor.value);
    return mix(mix(hash, range.antenna), range.seq.value_or(0));
  }
  return mix(hash, std::get<Fix>(row).seq.value_or(0));
}

Range corrected(const JudgedRange& judged) {
  Range out = judged.range;
  const double bias_m = judged.model ? judged.model->bias_m.value_or(0) : 0;
  if (out.distance_m - bias_m > k_least_range_m) out.distance_m -= bias_m;
  return out;
}

std::optional<RangeBelief> belief_of(const JudgedRange& judged) {
  if (!judged.model || !judged.model->belief) return std::nullopt;
  const bool taken = judged.range.distance_m - judged.model->bias_m.value_or(0) > k_least_range_m;
  return taken ? judged.model->belief : std::nullopt;
}

}  // namespace anchord::api
