#include "api/stream/unseen.hpp"

#include <algorithm>

namespace anchord::api {

void Unseen::sent(std::int64_t now_us) {
  ++sent_;
  if (!reports_) return;
  unread_.push_back({now_us, unread_.size() + 1});
  was_full_ = was_full_ || unread_.size() >= window_;
}

bool Unseen::seen(std::uint64_t frames, std::int64_t now_us) {
  if (frames > sent_) return false;
  if (!reports_) {
    // When those before were sent nobody kept: they count from now, and say nothing of the way.
    reports_ = true;
    seen_ = frames;
    timed_from_ = sent_;
    for (std::uint64_t i = frames; i < sent_; ++i) unread_.push_back({now_us, unread_.size() + 1});
    return true;
  }
  for (; seen_ < frames; ++seen_) {
    if (seen_ + 1 == frames && seen_ >= timed_from_) judge(unread_.front(), now_us);
    unread_.pop_front();
  }
  return true;
}

void Unseen::judge(const Sent& frame, std::int64_t now_us) {
  const std::int64_t lag_us = std::max<std::int64_t>(0, now_us - frame.at_us);
  quickest_us_ = std::min(quickest_us_, lag_us);
  const std::int64_t late_us = lag_us - quickest_us_;
  if (late_us > k_lag_us) {
    const auto read_in_time =
        static_cast<std::size_t>(static_cast<std::int64_t>(frame.place) * k_lag_us / late_us);
    window_ = std::max(k_narrowest, std::min(window_, read_in_time));
  } else if (late_us <= k_lag_us / 2 && was_full_ && seen_ >= judged_at_) {
    window_ = std::min(k_widest, window_ + 1);
  } else {
    return;
  }
  was_full_ = false;
  judged_at_ = sent_;
}

bool Unseen::open(std::int64_t now_us) const {
  if (unread_.empty()) return true;
  return unread_.size() < window_ && now_us - unread_.front().at_us <= quickest_us_ + k_lag_us;
}

}  // namespace anchord::api
