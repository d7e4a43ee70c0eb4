#include "server/app/rate_limit.hpp"

#include <algorithm>
#include <cmath>

namespace anchord::server {

std::optional<int> RateLimit::take(std::string_view name, Clock::time_point now) {
  auto buckets = buckets_.lock();
  auto at = buckets->find(name);
  if (at == buckets->end()) {
    if (buckets->size() >= max_names_) {
      buckets->erase(
          std::ranges::min_element(*buckets, {}, [](const auto& entry) { return entry.second.seen; }));
    }
    at = buckets->emplace(std::string(name), Bucket{burst_, now}).first;
  }
  Bucket& bucket = at->second;
  const double elapsed_s = std::chrono::duration<double>(now - bucket.seen).count();
  bucket.level = std::min(burst_, bucket.level + elapsed_s * per_s_);
  bucket.seen = now;
  if (bucket.level < 1) return std::max(1, static_cast<int>(std::ceil((1 - bucket.level) / per_s_)));
  bucket.level -= 1;
  return std::nullopt;
}

}  // namespace anchord::server
