#include "core/flight/rows.hpp"

#include <functional>

namespace anchord::flight {
namespace {

constexpr double k_least_range_m = 0.05;  // what radios report for a failure lies below it

std::size_t mix(std::size_t seed, std::uint64_t value) {
  return seed ^ (std::hash<std::uint64_t>{}(value) + 0x9e3779b97f4a7c15ULL + (seed << 6) + (seed >> 2));
}

}  // namespace

UtcTime time_of(const LiveRow& row) {
  return std::visit([](const auto& r) { return r.time; }, row);
}

std::size_t identity(const Range& range) {
  std::size_t hash = mix(0, static_cast<std::uint64_t>(range.time.ns));
  hash = mix(mix(hash, range.tag.value), range.anchor.value);
  return mix(mix(hash, range.antenna), range.seq.value_or(0));
}

std::size_t identity(const Fix& fix) {
  return mix(mix(1, static_cast<std::uint64_t>(fix.time.ns)), fix.seq.value_or(0));
}

std::size_t identity(const LiveRow& row) {
  if (const auto* judged = std::get_if<PredictedRange>(&row)) return identity(judged->range);
  return identity(std::get<Fix>(row));
}

bool RowsAhead::note(const Range& range) {
  const auto [at, is_first] = ranges_.try_emplace({range.tag, range.anchor, range.antenna}, range.time);
  if (!is_first && !(at->second < range.time)) return false;
  at->second = range.time;
  return true;
}

bool RowsAhead::note(const Fix& fix) {
  if (fix_ && !(*fix_ < fix.time)) return false;
  fix_ = fix.time;
  return true;
}

Range corrected(const PredictedRange& judged) {
  Range out = judged.range;
  const double bias_m = judged.model ? judged.model->bias_m.value_or(0) : 0;
  if (out.distance_m - bias_m > k_least_range_m) out.distance_m -= bias_m;
  return out;
}

std::optional<RangeErrorModel> error_model_of(const PredictedRange& judged) {
  if (!judged.model || !judged.model->error_model) return std::nullopt;
  const bool taken = judged.range.distance_m - judged.model->bias_m.value_or(0) > k_least_range_m;
  return taken ? judged.model->error_model : std::nullopt;
}

}  // namespace anchord::flight
