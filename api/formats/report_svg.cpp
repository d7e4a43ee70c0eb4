#include "api/formats/report_svg.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/base/text.hpp"
#include "core/localize/error_ellipse.hpp"

namespace anchord::report {
namespace {

constexpr std::size_t k_name_bytes = 24;  // on the map; the table below it has the whole name

std::string short_name(const std::string& name) {
  return name.size() <= k_name_bytes ? name : to_utf8(name, k_name_bytes) + "\u2026";
}

constexpr double k_width = 560, k_height = 338, k_foot = 30;

std::string px(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", std::isfinite(value) ? value : 0.0);
  return text;
}

/// 1, 2 or 5 times a power of ten, at most `most`.
double round_step(double most) {
  const double power = std::pow(10.0, std::floor(std::log10(std::max(most, 1e-9))));
  for (const double step : {5.0, 2.0, 1.0}) {
    if (step * power <= most * (1 + 1e-9)) return step * power;
  }
  return power;
}

/// A line through the points that are finite.
std::string curve(const char* css, const std::vector<Eigen::Vector2d>& points) {
  std::string path;
  for (const auto& at : points)
    if (at.allFinite()) path += (path.empty() ? "M" : " ") + px(at.x()) + ' ' + px(at.y());
  return path.empty() ? path : "<path class=\"" + std::string(css) + "\" d=\"" + path + "\"/>";
}

std::string marks(const char* css, const std::vector<Eigen::Vector2d>& points) {
  std::string out;
  for (const auto& at : points) {
    if (at.allFinite())
      out += "<circle class=\"" + std::string(css) + " m\" cx=\"" + px(at.x()) + "\" cy=\"" + px(at.y()) +
             "\" r=\"1.8\"/>";
  }
  return out;
}

struct View {
  double west{}, north{}, per_metre{1};
  double x(double east_m) const { return (east_m - west) * per_metre; }
  double y(double north_m) const { return (north - north_m) * per_metre; }
};

View fit(const Report& report) {
  double west = std::numeric_limits<double>::infinity(), east = -west, south = west, north = -west;
  const auto take = [&](double e, double n) {
    if (!std::isfinite(e) || !std::isfinite(n)) return;
    west = std::min(west, e);
    east = std::max(east, e);
    south = std::min(south, n);
    north = std::max(north, n);
  };
  for (const auto& at : report.outline_m) take(at.x(), at.y());
  for (const auto& anchor : report.anchors) {
    if (anchor.estimate.best)
      take(anchor.estimate.best->position.m.x(), anchor.estimate.best->position.m.y());
    if (anchor.estimate.mirror)
      take(anchor.estimate.mirror->position.m.x(), anchor.estimate.mirror->position.m.y());
  }
  for (const auto& flight : report.evidence.flights) {
    for (const auto& at : flight.track_m) take(at.x(), at.y());
  }
  if (!std::isfinite(west)) {
    west = south = -5;
    east = north = 5;
  }
  const double pad = 0.06 * std::max({east - west, north - south, 2.0}) + 0.5;
  west -= pad;
  east += pad;
  south -= pad;
  north += pad;
  View view;
  view.per_metre = std::min(k_width / (east - west), (k_height - k_foot) / (north - south));
  view.west = (west + east) / 2 - k_width / 2 / view.per_metre;
  view.north = (south + north) / 2 + (k_height - k_foot) / 2 / view.per_metre;
  return view;
}

std::string line(double x1, double y1, double x2, double y2, const char* css) {
  return "<line class=\"" + std::string(css) + "\" x1=\"" + px(x1) + "\" y1=\"" + px(y1) + "\" x2=\"" +
         px(x2) + "\" y2=\"" + px(y2) + "\"/>";
}

std::string label(double x, double y, const std::string& text, const char* css,
                  const char* anchor = "start") {
  return "<text class=\"" + std::string(css) + "\" x=\"" + px(x) + "\" y=\"" + px(y) + "\" text-anchor=\"" +
         anchor + "\">" + html_text(text) + "</text>";
}

/// Filled and checked: may be accepted; ring: measured but held back.
std::string symbol(double x, double y, const ReportAnchor& anchor) {
  const bool good = anchor.published || anchor.estimate.acceptable();
  const char* css = good ? (anchor.overridden ? "over" : "good") : "held";
  std::string out =
      "<circle class=\"" + std::string(css) + " dot\" cx=\"" + px(x) + "\" cy=\"" + px(y) + "\" r=\"6\"/>";
  if (good)
    out += "<path class=\"tick\" d=\"M" + px(x - 2.8) + ' ' + px(y) + "l2 2.2 3.8-4.2\"/>";
  else
    out += line(x - 3, y, x + 3, y, "dash");
  return out;
}

/// The largest of these that keeps every ellipse below a seventh of the map.
double magnification(const Report& report, const View& view) {
  double worst_m = 0;
  for (const auto& anchor : report.anchors) {
    if (anchor.estimate.acceptable() || anchor.published) worst_m = std::max(worst_m, anchor.estimate.h95_m);
  }
  double chosen = 1;
  for (const double factor : {2.0, 5.0, 10.0, 20.0, 50.0, 100.0}) {
    if (worst_m > 0 && worst_m * factor * view.per_metre < k_height / 12) chosen = factor;
  }
  return chosen;
}

std::string ellipse(const Hypothesis& at, const View& view, double factor, const char* css) {
  if (!at.covariance_m2.allFinite()) return {};
  const ErrorEllipse e = error_ellipse(at.covariance_m2);
  const double x = view.x(at.position.m.x()), y = view.y(at.position.m.y());
  const double rx = e.major_m * factor * view.per_metre, ry = e.minor_m * factor * view.per_metre;
  if (rx > 4 * k_width) return {};
  return "<ellipse class=\"" + std::string(css) + "\" cx=\"" + px(x) + "\" cy=\"" + px(y) + "\" rx=\"" +
         px(rx) + "\" ry=\"" + px(ry) + "\" transform=\"rotate(" + px(e.azimuth_deg - 90) + ' ' + px(x) +
         ' ' + px(y) + ")\"/>";
}

std::string scale_bars(const View& view, double factor) {
  const double metre = round_step(110 / view.per_metre), small = round_step(60 / view.per_metre / factor);
  const double y = k_height - 20, x = 200, x2 = 330;
  const auto bar = [&](double at, double length, const std::string& text) {
    return "<path class=\"scale\" d=\"M" + px(at) + ' ' + px(y - 4) + "v5h" + px(length) + "v-5\"/>" +
           label(at, y + 15, text, "t");
  };
  char first[32], second[64];
  std::snprintf(first, sizeof first, "%g m", metre);
  std::snprintf(second, sizeof second, "%g m in ellipses (×%g)", small, factor);
  return bar(x, metre * view.per_metre, first) + bar(x2, small * factor * view.per_metre, second);
}

std::string polyline(const std::vector<Eigen::Vector2d>& points, const View& view, const char* css,
                     bool closed) {
  if (points.size() < 2) return {};
  std::string out = "<path class=\"" + std::string(css) + "\" d=\"M";
  for (std::size_t i = 0; i < points.size(); ++i)
    out += (i == 0 ? "" : " ") + px(view.x(points[i].x())) + ' ' + px(view.y(points[i].y()));
  return out + (closed ? "Z" : "") + "\"/>";
}

/// The place of each label: right of its symbol, unless another symbol lies there.
bool crowded(const Report& report, const View& view, std::size_t index) {
  const auto& here = report.anchors[index].estimate.best->position.m;
  const double x = view.x(here.x()), y = view.y(here.y());
  if (x > k_width - 96) return true;
  for (std::size_t i = 0; i < report.anchors.size(); ++i) {
    const auto& other = report.anchors[i].estimate.best;
    if (i == index || !other) continue;
    const double dx = view.x(other->position.m.x()) - x, dy = view.y(other->position.m.y()) - y;
    if (dx > 0 && dx < 96 && std::abs(dy) < 22) return x > 96;
  }
  return false;
}

}  // namespace

std::string fixed(double value, int decimals) {
  if (!std::isfinite(value)) return "–";
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", decimals, std::abs(value));
  const bool zero = std::string_view(text).find_first_not_of("0.") == std::string_view::npos;
  return (value < 0 && !zero ? "−" : "") + std::string(text);
}

double distance_m(const Eigen::Vector3d& at, const Eigen::Vector3d& reference_m) {
  const Eigen::Vector3d off = at - reference_m;
  return std::isfinite(off.z()) ? off.norm() : off.head<2>().norm();
}

std::string map(const Report& report) {
  const View view = fit(report);
  const double factor = magnification(report, view);
  std::string out =
      "<svg class=\"map\" viewBox=\"0 0 560 338\" role=\"img\" aria-label=\"Map of the anchors with "
      "their 95 % ellipses\">";
  const double grid = round_step(90 / view.per_metre);
  for (double e = std::ceil(view.west / grid) * grid; view.x(e) < k_width; e += grid)
    out += line(view.x(e), 0, view.x(e), k_height, "grid");
  for (double n = std::floor(view.north / grid) * grid; view.y(n) < k_height; n -= grid)
    out += line(0, view.y(n), k_width, view.y(n), "grid");
  for (const auto& flight : report.evidence.flights) out += polyline(flight.track_m, view, "track", false);
  out += polyline(report.outline_m, view, "wall", true);
  for (const auto& anchor : report.anchors) {
    const auto& e = anchor.estimate;
    if (!e.best) continue;
    if (e.mirror) {
      out += line(view.x(e.best->position.m.x()), view.y(e.best->position.m.y()),
                  view.x(e.mirror->position.m.x()), view.y(e.mirror->position.m.y()), "link");
      out += "<circle class=\"mirror\" cx=\"" + px(view.x(e.mirror->position.m.x())) + "\" cy=\"" +
             px(view.y(e.mirror->position.m.y())) + "\" r=\"6\"/>";
    }
    const bool good = anchor.published || e.acceptable();
    out += ellipse(*e.best, view, good ? factor : 1,
                   good ? (anchor.overridden ? "ell over" : "ell good") : "ell held");
  }
  for (std::size_t i = 0; i < report.anchors.size(); ++i) {
    const auto& anchor = report.anchors[i];
    if (!anchor.estimate.best) continue;
    const double x = view.x(anchor.estimate.best->position.m.x()),
                 y = view.y(anchor.estimate.best->position.m.y());
    const bool left = crowded(report, view, i);
    const char* side = left ? "end" : "start";
    const double at = left ? x - 11 : x + 11;
    out += symbol(x, y, anchor);
    out += label(at, y - 1, anchor.name.empty() ? to_string(anchor.estimate.anchor) : short_name(anchor.name),
                 "id", side);
    const bool good = anchor.published || anchor.estimate.acceptable();
    out +=
        label(at, y + 11, good ? "±" + fixed(anchor.estimate.h95_m * 100, 0) + " cm" : "withheld", "t", side);
  }
  out += scale_bars(view, factor);
  if (report.frame == TrackFrame::wgs84)
    out += "<path class=\"scale\" d=\"M528 328v-14m-3.5 5l3.5-6 3.5 6\"/>" + label(537, 328, "N", "id");
  return out + "</svg>";
}

std::string residuals(const std::vector<const std::vector<RangeResidual>*>& flights) {
  constexpr double w = 268, h = 92, left = 30, foot = 14;
  double most = 0.1;
  std::vector<double> sizes;
  for (const auto* rows : flights) {
    for (const auto& r : *rows) {
      if (std::isfinite(r.residual_m) && r.weight > 0) sizes.push_back(std::abs(r.residual_m));
    }
  }
  if (!sizes.empty()) {
    std::ranges::sort(sizes);
    most = std::max(0.05, 1.5 * sizes[sizes.size() * 98 / 100]);
  }
  const double step = round_step(most);
  const auto y = [&](double v) {
    return (h - foot) / 2 - std::clamp(v / most, -1.0, 1.0) * ((h - foot) / 2 - 3);
  };
  std::string out =
      "<svg class=\"plot\" viewBox=\"0 0 268 92\" role=\"img\" aria-label=\"Residuals over time\">";
  for (const double v : {-step, 0.0, step}) {
    out += line(left, y(v), w, y(v), v == 0 ? "axis" : "grid");
    out += label(left - 4, y(v) + 3, fixed(v, step < 0.095 ? 2 : 1), "t", "end");
  }
  const double width = (w - left) / static_cast<double>(std::max<std::size_t>(1, flights.size()));
  for (std::size_t f = 0; f < flights.size(); ++f) {
    const auto& rows = *flights[f];
    if (rows.empty()) continue;
    const double start = left + width * static_cast<double>(f) + 2;
    const double length = std::max(1.0, static_cast<double>(rows.back().time.ns - rows.front().time.ns));
    if (f > 0) out += line(start - 2, 0, start - 2, h - foot, "axis");
    for (const auto& r : rows) {
      if (!std::isfinite(r.residual_m)) continue;
      const double x = start + (width - 5) * static_cast<double>(r.time.ns - rows.front().time.ns) / length;
      const double at = y(r.residual_m);
      if (r.weight > 0)
        out += "<circle class=\"pt\" cx=\"" + px(x) + "\" cy=\"" + px(at) + "\" r=\"1.1\"/>";
      else
        out += "<path class=\"rej\" d=\"M" + px(x - 1.6) + ' ' + px(at - 1.6) + "l3.2 3.2m0-3.2l-3.2 3.2\"/>";
    }
    out += label(start, h - 3, fixed(length / 1e9, 0) + " s", "t");
  }
  return out + "</svg>";
}

std::string course(const std::vector<ConvergenceStep>& steps, const Eigen::Vector3d& reference) {
  constexpr double w = 268, h = 104, left = 34, foot = 16;
  double most = 0.02;
  const auto error = [&](const std::optional<Eigen::Vector3d>& at) {
    return at ? distance_m(*at, reference) : std::numeric_limits<double>::quiet_NaN();
  };
  for (const auto& s : steps) {
    for (const double v : {error(s.raw_m), error(s.corrected_m)}) {
      if (std::isfinite(v)) most = std::max(most, v);
    }
  }
  // Logarithmic: the first iterations are metres, the last millimetres.
  const double low = std::max(1e-3, most / 1000);
  const auto y = [&](double v) {
    const double share =
        (std::log(std::clamp(v, low, most)) - std::log(low)) / (std::log(most) - std::log(low));
    return (h - foot) - share * (h - foot - 6);
  };
  const double n = static_cast<double>(std::max<std::size_t>(2, steps.size()));
  const auto x = [&](std::size_t i) { return left + 8 + (w - left - 16) * static_cast<double>(i) / (n - 1); };
  std::string out =
      "<svg class=\"plot\" viewBox=\"0 0 268 104\" role=\"img\" aria-label=\"Error per iteration\">";
  for (double v = 1e-3; v <= most * 1.0001; v *= 10) {
    if (v < low) continue;
    out += line(left, y(v), w, y(v), "grid");
    out += label(left - 4, y(v) + 3,
                 v < 0.0095  ? "1 mm"
                 : v < 0.095 ? "1 cm"
                 : v < 0.95  ? "10 cm"
                             : fixed(v, 0) + " m",
                 "t", "end");
  }
  std::vector<Eigen::Vector2d> claim, raw, corrected;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    claim.emplace_back(x(i), y(steps[i].corrected_m ? steps[i].h95_m : std::nan("")));
    raw.emplace_back(x(i), y(error(steps[i].raw_m)));
    corrected.emplace_back(x(i), y(error(steps[i].corrected_m)));
    out += label(x(i), h - 3, std::to_string(i + 1), "t", "middle");
  }
  return out + curve("claim", claim) + curve("raw", raw) + marks("raw", raw) + curve("cor", corrected) +
         marks("cor", corrected) + "</svg>";
}

RangeErrors range_errors(const ConvergenceStep& step, const Eigen::Vector3d& reference) {
  if (!step.middle) return {};
  const double truth_m = distance_m(step.middle->tag_m, reference);
  return {step.middle->distance_m - truth_m, step.middle->corrected_m - truth_m};
}

std::string predicted_class(const ConvergenceStep& step) {
  if (step.n_los + step.n_nlos == 0) return "–";
  return step.n_los >= step.n_nlos ? "L" : "N";
}

std::string range_course(const std::vector<ConvergenceStep>& steps, const Eigen::Vector3d& reference) {
  constexpr double w = 268, h = 92, left = 34, foot = 16;
  double most = 0.02;
  for (const auto& s : steps) {
    const RangeErrors errors = range_errors(s, reference);
    for (const double v : {errors.raw_m, errors.corrected_m})
      if (std::isfinite(v)) most = std::max(most, std::abs(v));
  }
  const double zero = (h - foot) / 2, step = round_step(most);
  const auto y = [&](double v) { return zero - v / most * (zero - 4); };
  const double n = static_cast<double>(std::max<std::size_t>(2, steps.size()));
  std::string out =
      "<svg class=\"plot\" viewBox=\"0 0 268 92\" role=\"img\" aria-label=\"Range error per iteration\">";
  for (const double v : {-step, 0.0, step}) {
    out += line(left, y(v), w, y(v), v == 0 ? "axis" : "grid");
    out += label(left - 4, y(v) + 3, fixed(v, step < 0.095 ? 2 : 1), "t", "end");
  }
  std::vector<Eigen::Vector2d> raw, corrected;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double x = left + 8 + (w - left - 16) * static_cast<double>(i) / (n - 1);
    const RangeErrors errors = range_errors(steps[i], reference);
    raw.emplace_back(x, y(errors.raw_m));
    corrected.emplace_back(x, y(errors.corrected_m));
    out += label(x, h - 3, predicted_class(steps[i]), "t", "middle");
  }
  return out + curve("raw", raw) + marks("raw", raw) + curve("cor", corrected) + marks("cor", corrected) +
         "</svg>";
}

}  // namespace anchord::report
