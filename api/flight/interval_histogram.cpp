#include "api/flight/interval_histogram.hpp"

#include <algorithm>

namespace anchord::api {

void IntervalHistogram::note(double now_s) {
  if (last_s_) {
    const double passed_s = now_s - *last_s_;
    const auto bucket = std::lower_bound(k_bounds_s.begin(), k_bounds_s.end(), passed_s) - k_bounds_s.begin();
    ++counts_[static_cast<std::size_t>(bucket)];
    sum_s_ = sum_s_ + passed_s;
    worst_s_ = std::max<double>(worst_s_, passed_s);
  }
  last_s_ = now_s;
}

std::string IntervalHistogram::text(std::string_view name) const {
  const std::string of(name);
  const auto number = [](double value) {
    std::string out = std::to_string(value);
    out.erase(out.find_last_not_of('0') + 1);
    if (out.back() == '.') out.pop_back();
    return out;
  };
  std::string out =
      "# HELP " + of + " Time from one round of the safety checks to the next\n# TYPE " + of + " histogram\n";
  std::uint64_t n = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    n += counts_[i];
    out += of + "_bucket{le=\"" + (i < k_bounds_s.size() ? number(k_bounds_s[i]) : "+Inf") + "\"} " +
           std::to_string(n) + '\n';
  }
  out += of + "_sum " + std::to_string(sum_s_) + '\n' + of + "_count " + std::to_string(n) + '\n';
  return out + "# HELP " + of +
         "_worst Longest time from one round of the safety checks to the next\n# TYPE " + of +
         "_worst gauge\n" + of + "_worst " + std::to_string(worst_s_) + '\n';
}

}  // namespace anchord::api
