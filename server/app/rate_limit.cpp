#include "server/app/rate_limit.hpp"

#include <algorithm>
#include <cmath>

namespace anchord::server {

std::optional<int> RateLimit::take(std::string_view name, const Rate& rate, Clock::time_point now) {
  auto buckets = buckets_.lock();
  auto at = buckets->find(name);
  if (at == buckets->end()) {
    if (buckets->size() >= max_names_) {
      buckets->erase(
          std::ranges::min_element(*buckets, {}, [](const auto& entry) { return entry.second.seen; }));
    }
    at = buckets->emplace(std::string(name), Bucket{rate.burst, now}).first;
  }
  Bucket& bucket = at->second;
  const double elapsed_s = std::chrono::duration<double>(now - bucket.seen).count();
  bucket.level = std::min(rate.burst, bucket.level + elapsed_s * rate.per_s);
  bucket.seen = now;
  if (bucket.level < 1) return std::max(1, static_cast<int>(std::ceil((1 - bucket.level) / rate.per_s)));
  bucket.level -= 1;
  return std::nullopt;
}

}  // namespace anchord::server
