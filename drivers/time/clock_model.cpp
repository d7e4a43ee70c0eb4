#include "drivers/time/clock_model.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/median.hpp"

namespace anchord::timing {
namespace {

struct Xy {
  double x{}, y{};  ///< seconds of device time, nanoseconds of lag, both from a reference
};

/// Median of the slopes of all pairs: up to 29 % of the points may be anything. At most 120 points, once a
/// second.
double theil_sen(const std::vector<Xy>& points) {
  std::vector<double> slopes;
  slopes.reserve(points.size() * points.size() / 2);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = i + 1; k < points.size(); ++k) {
      if (points[k].x > points[i].x)
        slopes.push_back((points[k].y - points[i].y) / (points[k].x - points[i].x));
    }
  }
  return slopes.empty() ? 0 : upper_median(slopes);
}

/// Points that do not lie impossibly early.
std::vector<Xy> without_early(const std::vector<Xy>& points) {
  const double slope = theil_sen(points);
  std::vector<double> residuals;
  for (const auto& p : points) residuals.push_back(p.y - slope * p.x);
  std::vector<double> off = residuals;
  const double center = upper_median(off);
  off.clear();
  for (const double r : residuals) off.push_back(std::abs(r - center));
  const double bound = center - 8 * std::max(upper_median(off), 10'000.0);  // 10 us: clocks have ticks
  std::vector<Xy> out;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (residuals[i] >= bound) out.push_back(points[i]);
  }
  return out;
}

/// Lower convex hull, left to right. Points come in order of x.
std::vector<Xy> lower_hull(const std::vector<Xy>& points) {
  std::vector<Xy> hull;
  for (const auto& p : points) {
    while (hull.size() >= 2) {
      const auto& a = hull[hull.size() - 2];
      const auto& b = hull.back();
      if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) > 0) break;
      hull.pop_back();
    }
    hull.push_back(p);
  }
  return hull;
}

}  // namespace

std::int64_t Unwrap::operator()(std::uint64_t raw) {
  const auto value = static_cast<std::int64_t>(raw) & (modulus_ - 1);
  if (!last_) return *(last_ = value);
  auto step = (value - *last_) % modulus_;
  if (step < -modulus_ / 2) step += modulus_;
  if (step >= modulus_ / 2) step -= modulus_;
  return *(last_ = *last_ + step);
}

void ClockModel::restart() {
  buckets_.clear();
  samples_ = 0;
  slope_ = scale_ns_ = spread_s_ = 0;
  early_ = 0;
  late_ = false;
}

bool ClockModel::drift_too_large() const {
  // Of a short stretch delays alone can look like drift: it must have added up to more than they explain.
  if (!drift_known() || std::abs(slope_) <= 2e-4) return false;
  const auto stretch_ns = static_cast<double>(buckets_.back().device_ns - buckets_.front().device_ns);
  return std::abs(slope_) * stretch_ns > 1e7 + 5 * scale_ns_;
}

bool ClockModel::jumped(std::int64_t device_ns, std::int64_t arrival_ns) {
  if (device_ns < last_device_ns_ - options_.bucket_ns) return true;  // it began anew
  const double off = static_cast<double>(arrival_ns - device_ns) - lag_at(device_ns);
  // Until a few stretches are known, the earlier sample is simply the better one: the first may have been
  // late.
  if (buckets_.size() < 5) return false;
  early_ = off < -static_cast<double>(options_.early_ns) - 5 * sigma_at(device_ns) ? early_ + 1 : 0;
  if (early_ >= 3) return true;  // one or two are a damaged number
  if (off < static_cast<double>(options_.late_ns)) {
    late_ = false;
    return false;
  }
  if (!late_) late_since_ns_ = arrival_ns;
  late_ = true;
  return arrival_ns - late_since_ns_ > options_.late_span_ns;
}

void ClockModel::add(std::int64_t device_ns, std::int64_t arrival_ns) {
  if (samples_ > 0 && jumped(device_ns, arrival_ns)) {
    ++jumps_;
    restart();
  }
  // A sample so early that it cannot be: counted above, not fitted.
  if (early_ > 0) return;
  ++samples_;
  last_device_ns_ = samples_ == 1 ? device_ns : std::max(last_device_ns_, device_ns);
  const Point point{device_ns, arrival_ns - device_ns};
  const auto number = device_ns / options_.bucket_ns;
  if (buckets_.empty() || number > bucket_) {
    fit();  // the buckets before this one are whole
    bucket_ = number;
    buckets_.push_back(point);
    if (buckets_.size() > options_.window_buckets) buckets_.pop_front();
  } else if (number == bucket_ && point.lag_ns < buckets_.back().lag_ns) {
    buckets_.back() = point;
  }
  if (buckets_.size() < 4) fit();
}

void ClockModel::fit() {
  if (buckets_.empty()) return;
  reference_ns_ = buckets_.back().device_ns;
  const auto base = buckets_.back().lag_ns;
  std::vector<Xy> points;
  points.reserve(buckets_.size());
  for (const auto& p : buckets_) {
    points.push_back(
        {static_cast<double>(p.device_ns - reference_ns_) * 1e-9, static_cast<double>(p.lag_ns - base)});
  }
  if (points.size() >= 5) points = without_early(points);
  double mean_x = 0;
  for (const auto& p : points) mean_x += p.x / static_cast<double>(points.size());

  double intercept = 0;
  slope_ = 0;
  const auto hull = lower_hull(points);
  // Too short a stretch says nothing of the drift: the least lag alone.
  if (points.size() < 4 || hull.size() < 2) {
    intercept =
        std::min_element(points.begin(), points.end(), [](const Xy& a, const Xy& b) { return a.y < b.y; })->y;
  } else {
    std::size_t k = 1;
    while (k + 1 < hull.size() && hull[k].x < mean_x) ++k;
    const auto &a = hull[k - 1], &b = hull[k];
    const double limit = options_.max_drift * 1e9;
    const double slope = std::clamp((b.y - a.y) / (b.x - a.x), -limit, limit);
    intercept = a.y - slope * a.x;
    slope_ = slope * 1e-9;
  }
  lag_ns_ = static_cast<double>(base) + intercept;

  std::vector<double> above;
  double square = 0;
  for (const auto& p : points) {
    above.push_back(std::max(0.0, p.y - intercept - slope_ * 1e9 * p.x));
    square += (p.x - mean_x) * (p.x - mean_x) / static_cast<double>(points.size());
  }
  scale_ns_ = upper_median(above) / std::log(2.0);  // median of an exponential is ln 2 of its mean
  spread_s_ = std::sqrt(square);
}

double ClockModel::lag_at(std::int64_t device_ns) const {
  return lag_ns_ + slope_ * static_cast<double>(device_ns - reference_ns_);
}

/// The least of n exponential delays lies scale/n above the line, and the line leans by as much over the
/// spread. 0.1 ms at least: the scheduler between the wire and our clock reading. Unknown drift counts as 20
/// ppm.
double ClockModel::sigma_at(std::int64_t device_ns) const {
  const double n = static_cast<double>(std::max<std::size_t>(buckets_.size(), 1));
  const double away_s = std::abs(static_cast<double>(device_ns - reference_ns_)) * 1e-9;
  const double lean = spread_s_ > 0 && buckets_.size() >= 4 ? 2 * scale_ns_ / n * (1 + away_s / spread_s_)
                                                            : std::max(scale_ns_, 1e6) + 20e-6 * 1e9 * away_s;
  return std::hypot(1e5, lean);
}

std::optional<Stamp> ClockModel::stamp(std::int64_t device_ns, std::int64_t arrival_ns) {
  add(device_ns, arrival_ns);
  const auto found = steady_of(device_ns);
  if (!found || found->ns > arrival_ns + options_.early_ns || found->ns < arrival_ns - options_.late_span_ns)
    return std::nullopt;
  return found;
}

std::optional<Stamp> ClockModel::steady_of(std::int64_t device_ns) const {
  if (buckets_.empty()) return std::nullopt;
  return Stamp{device_ns + static_cast<std::int64_t>(std::llround(lag_at(device_ns))), sigma_at(device_ns)};
}

std::optional<Stamp> ClockModel::device_of(std::int64_t steady_ns) const {
  if (buckets_.empty()) return std::nullopt;
  // arrival = device + lag + slope (device - reference), solved for device.
  const double since = static_cast<double>(steady_ns - reference_ns_) - lag_ns_;
  const auto device = reference_ns_ + static_cast<std::int64_t>(std::llround(since / (1 + slope_)));
  return Stamp{device, sigma_at(device)};
}

}  // namespace anchord::timing
