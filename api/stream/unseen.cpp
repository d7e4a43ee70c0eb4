#include "api/stream/unseen.hpp"

#include <algorithm>

namespace anchord::api {

void Unseen::sent(std::int64_t now_us) {
  ++sent_;
  if (reports_) sent_us_.push_back(now_us);
}

bool Unseen::seen(std::uint64_t frames, std::int64_t now_us) {
  if (frames > sent_) return false;
  if (!reports_) {
    // When those before were sent nobody kept: they count from now, and say nothing of the way.
    reports_ = true;
    seen_ = frames;
    timed_from_ = sent_;
    sent_us_.assign(sent_ - frames, now_us);
    return true;
  }
  for (; seen_ < frames; ++seen_) {
    if (seen_ + 1 == frames && seen_ >= timed_from_)
      quickest_us_ = std::min(quickest_us_, std::max<std::int64_t>(0, now_us - sent_us_.front()));
    sent_us_.pop_front();
  }
  return true;
}

bool Unseen::open(std::int64_t now_us) const {
  return sent_us_.empty() || now_us - sent_us_.front() <= quickest_us_ + k_lag_us;
}

}  // namespace anchord::api
