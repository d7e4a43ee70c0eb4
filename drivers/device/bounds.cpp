#include "drivers/device/bounds.hpp"

#include "core/types/live_limits.hpp"

namespace anchord::device {

bool Noise::is_worth_recording(std::uint64_t bytes, std::int64_t steady_ns, bool in_a_flight,
                               const NoiseLimits& limits) {
  bytes_ += bytes;
  if (bytes_ <= (in_a_flight ? limits.in_a_flight_bytes : limits.else_bytes)) return true;
  constexpr std::int64_t k_minute_ns = 60'000'000'000;
  if (sample_since_ns_ == 0 || steady_ns - sample_since_ns_ >= k_minute_ns) {
    sample_since_ns_ = steady_ns;
    sampled_ = 0;
  }
  if (sampled_ >= limits.sample_bytes) {
    skipped_ = true;
    return false;
  }
  sampled_ += bytes;
  return true;
}

void SentIds::note(const Range& range) {
  auto& tags = range.kind == RangeKind::anchor_anchor ? anchors_ : tags_;
  if (tags.size() <= k_most_live_anchors) tags.insert(range.tag);
  if (anchors_.size() <= k_most_live_anchors) anchors_.insert(range.anchor);
}

std::string SentIds::trouble() const {
  const bool tags = tags_.size() > k_most_live_tags;
  if (!tags && anchors_.size() <= k_most_live_anchors) return {};
  return "it sends more than " +
         (tags ? std::to_string(k_most_live_tags) + " tag ids"
               : std::to_string(k_most_live_anchors) + " anchor ids") +
         ": a flight follows the first of them only, all rows are stored; are tag and anchor of its mapping "
         "right?";
}

}  // namespace anchord::device
