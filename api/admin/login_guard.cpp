#include "api/admin/login_guard.hpp"

#include <algorithm>
#include <cmath>

namespace anchord::api {
namespace {

/// reliability.md: five tries a minute per account and address. An address may stand for a few people, and a
/// token may be mistyped at several places.
constexpr double k_minute_s = 60;
constexpr double k_both = 5, k_address = 20, k_token = 100;
constexpr double k_longest_wait_s = 60;

/// "anc_<32 digits>_..." -> the 32 digits; else one name for all that is no token.
std::string_view public_part(std::string_view text) {
  constexpr std::string_view k_prefix = "anc_";
  constexpr std::size_t k_digits = 32;
  if (!text.starts_with(k_prefix) || text.size() < k_prefix.size() + k_digits) return "other";
  return text.substr(k_prefix.size(), k_digits);
}

}  // namespace

std::optional<int> LoginGuard::failed(std::string_view token_text, std::string_view address,
                                      Clock::time_point now) {
  const std::string token(public_part(token_text)), from(address);
  auto buckets = buckets_.lock();
  const auto wait_of = [&](const std::string& name, double a_minute) {
    return take(*buckets, name, a_minute, a_minute / k_minute_s, now);
  };
  std::optional<int> wait;
  for (const auto& one :
       {wait_of("both " + token + ' ' + from, k_both), wait_of("address " + from, k_address),
        token == "other" ? std::nullopt : wait_of("token " + token, k_token)}) {
    if (one) wait = std::max(wait.value_or(0), *one);
  }
  return wait;
}

std::optional<int> LoginGuard::take(Buckets& buckets, const std::string& name, double burst, double per_s,
                                    Clock::time_point now) {
  auto at = buckets.find(name);
  if (at == buckets.end()) {
    if (buckets.size() >= k_max_names) {
      buckets.erase(
          std::ranges::min_element(buckets, {}, [](const auto& entry) { return entry.second.seen; }));
    }
    at = buckets.emplace(name, Bucket{burst, now}).first;
  }
  Bucket& bucket = at->second;
  const double elapsed_s = std::chrono::duration<double>(now - bucket.seen).count();
  bucket.level = std::min(burst, bucket.level + elapsed_s * per_s) - 1;
  bucket.seen = now;
  if (bucket.level >= 0) return std::nullopt;
  // Below zero: every failure makes the wait longer, to a bound, so that a mistake of yesterday is over
  // today.
  bucket.level = std::max(bucket.level, -k_longest_wait_s * per_s);
  return std::max(1, static_cast<int>(std::ceil(-bucket.level / per_s)));
}

}  // namespace anchord::api
