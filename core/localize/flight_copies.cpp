#include "core/localize/flight_copies.hpp"

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstdint>
#include <functional>
#include <numeric>

namespace anchord {
namespace {

std::uint64_t mixed(std::uint64_t sum, std::uint64_t value) {
  sum = (sum ^ value) * 0x9e3779b97f4a7c15U;
  return sum ^ sum >> 29;
}

/// As many rows of one anchor in a row are never twice the same by chance, not even of a tag that stands
/// still.
constexpr std::size_t k_run = 6;

/// Of every run of ranges of one anchor, in order: its distances to the millimetre, and the times between
/// them, which stay the same where a flight is played again at another hour.
std::vector<std::uint64_t> keys_of(const FlightData& flight) {
  struct Row {
    std::uint64_t pair;
    std::int64_t time_us, distance_mm;
    auto operator<=>(const Row&) const = default;
  };
  std::vector<Row> rows(flight.n_ranges());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const FlightRange range = flight.range(i);
    const double distance_m = flight.received_m.empty() ? range.distance_m : flight.received_m[i];
    rows[i] = {std::uint64_t{range.tag.value} << 32 | range.anchor.value, range.time.ns / 1000,
               std::abs(distance_m) < 1e6 ? std::llround(distance_m * 1000) : 0};
  }
  std::ranges::sort(rows);
  std::vector<std::uint64_t> out;
  for (std::size_t i = k_run - 1; i < rows.size(); ++i) {
    const std::size_t first = i + 1 - k_run;
    if (rows[first].pair != rows[i].pair) continue;
    std::uint64_t key = rows[i].pair;
    for (std::size_t k = first; k <= i; ++k) {
      key = mixed(key, static_cast<std::uint64_t>(rows[k].time_us - rows[first].time_us));
      key = mixed(key, static_cast<std::uint64_t>(rows[k].distance_mm));
    }
    out.push_back(key);
  }
  std::ranges::sort(out);
  return out;
}

std::size_t in_common(const std::vector<std::uint64_t>& a, const std::vector<std::uint64_t>& b) {
  std::size_t n = 0;
  for (auto i = a.begin(), k = b.begin(); i != a.end() && k != b.end();) {
    const auto way = *i <=> *k;
    n += way == 0 ? 1 : 0;
    if (way <= 0) ++i;
    if (way >= 0) ++k;
  }
  return n;
}

}  // namespace

std::vector<std::optional<std::size_t>> flight_copies(std::span<const FlightData* const> flights) {
  std::vector<std::optional<std::size_t>> copy_of(flights.size());
  if (flights.size() < 2) return copy_of;
  std::vector<std::vector<std::uint64_t>> keys;
  for (const FlightData* flight : flights) keys.push_back(keys_of(*flight));
  std::vector<std::size_t> largest_first(flights.size());
  std::iota(largest_first.begin(), largest_first.end(), std::size_t{0});
  std::ranges::stable_sort(largest_first, std::greater{}, [&](std::size_t i) { return keys[i].size(); });
  std::vector<std::size_t> counted;
  for (const std::size_t i : largest_first) {
    const auto original = std::ranges::find_if(
        counted, [&](std::size_t k) { return 2 * in_common(keys[i], keys[k]) > keys[i].size(); });
    if (original == counted.end())
      counted.push_back(i);
    else
      copy_of[i] = *original;
  }
  return copy_of;
}

std::string copy_note(const std::string& original) {
  return "it has the ranges of " + original + ": the same flight, which counts once";
}

}  // namespace anchord
