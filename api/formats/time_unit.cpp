#include "api/formats/time_unit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace anchord::api {
namespace {

struct TimeUnit {
  std::string_view word;
  double per_s;
};
constexpr std::array<TimeUnit, 4> k_time_units{{{"s", 1}, {"ms", 1e3}, {"us", 1e6}, {"ns", 1e9}}};
constexpr double k_year_2000_s = 946'684'800, k_year_2100_s = 4'102'444'800;

double middle(std::vector<double> values) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

std::string time_unit_warning(std::string_view name, std::span<const double> values) {
  const std::string_view named = name.ends_with("_us") ? "us" : name.ends_with("_ms") ? "ms" : "s";
  std::vector<double> times, steps;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    if (!times.empty() && v > times.back()) steps.push_back(v - times.back());
    times.push_back(v);
  }
  if (times.empty()) return {};
  const std::string begin = "the values of " + std::string(name) + " are ";
  const double typical = middle(times), step = steps.empty() ? 0 : middle(steps);
  for (const auto& unit : k_time_units) {
    const double s = typical / unit.per_s;
    // A clock that began with the device may read like years of another unit; ranges come within the minute.
    if (s < k_year_2000_s || s > k_year_2100_s || step / unit.per_s > 60) continue;
    if (unit.word == named) return {};
    return begin + std::string(unit.word) + " since 1970, not " + std::string(named) +
           ": name the column t_" + std::string(unit.word) + ", or convert it";
  }
  if (named == "us" && std::ranges::any_of(times, [](double v) { return v != std::floor(v); }))
    return begin +
           "no whole microseconds: seconds or milliseconds? Name the column t_s or t_ms, or convert it";
  return {};
}

}  // namespace anchord::api
