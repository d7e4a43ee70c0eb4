#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/ml/random.hpp"
#include "core/ml/sigmoid.hpp"
#include "core/ml/train.hpp"

namespace anchord::ml {
namespace {

constexpr std::size_t k_max_bins = 255;

// Features as bin numbers, column after column; a split "bin <= b" is "x < edge[b]".
struct Binned {
  std::size_t n{}, d{};
  std::vector<std::uint8_t> bin;
  std::vector<std::vector<double>> edges;  // per feature, upper edge of each bin but the last

  explicit Binned(const TrainingRows& rows) : n{rows.n()}, d{rows.d}, bin(rows.n() * rows.d), edges(rows.d) {
    std::vector<double> values(n), distinct;
    for (std::size_t f = 0; f < d; ++f) {
      for (std::size_t i = 0; i < n; ++i) values[i] = rows.x[i * d + f];
      auto sorted = values;
      std::sort(sorted.begin(), sorted.end());
      distinct.clear();
      std::unique_copy(sorted.begin(), sorted.end(), std::back_inserter(distinct));
      const auto add_edge = [&](double low, double high) {
        const double middle = 0.5 * (low + high);
        const double edge = middle > low ? middle : high;
        if (edges[f].empty() || edge > edges[f].back()) edges[f].push_back(edge);
      };
      if (distinct.size() <= k_max_bins) {
        for (std::size_t i = 0; i + 1 < distinct.size(); ++i) add_edge(distinct[i], distinct[i + 1]);
      } else {
        for (std::size_t b = 1; b < k_max_bins; ++b) {
          const double high = sorted[b * n / k_max_bins];
          const auto above = std::lower_bound(distinct.begin(), distinct.end(), high);
          if (above != distinct.begin()) add_edge(*(above - 1), high);
        }
      }
      for (std::size_t i = 0; i < n; ++i)
        bin[f * n + i] = static_cast<std::uint8_t>(
            std::upper_bound(edges[f].begin(), edges[f].end(), values[i]) - edges[f].begin());
    }
  }
};

struct Cell {
  double g{}, h{}, rows{};
  void add(const Cell& other) {
    g += other.g;
    h += other.h;
    rows += other.rows;
  }
};

struct GrowOptions {
  int max_depth{};
  double lambda{}, min_h{}, min_rows{};
  std::size_t features_per_split{};  // 0: all allowed
};

// Grows one tree on sums of g (target) and h (weight): leaf value G / (H + lambda), gain the drop of the
// squared loss.
class Grower {
 public:
  Grower(const Binned& data, const GrowOptions& options) : data_{data}, options_{options} {}

  // rows: indices, reordered in place; times: how often each row counts (bootstrap).
  void grow(Trees& out, std::vector<std::uint32_t>& rows, std::span<const double> g,
            std::span<const double> h, std::span<const double> times, std::vector<std::size_t> allowed,
            double leaf_scale, Random& random) {
    allowed_ = std::move(allowed);
    leaf_scale_ = leaf_scale;
    // What a row adds to a sum, side by side: the sums are most of the time, and of that most was waiting for
    // three arrays.
    share_.resize(data_.n);
    for (const auto r : rows) share_[r] = {times[r] * g[r], times[r] * h[r], times[r]};
    out.roots.push_back(static_cast<std::uint32_t>(out.nodes.size()));
    out.nodes.emplace_back();
    split(out, out.roots.back(), rows, 0, rows.size(), 0, random);
  }

 private:
  struct Best {
    double gain{1e-12};
    std::size_t feature{}, bin{};
    bool found{false};
  };

  void split(Trees& out, std::size_t node, std::vector<std::uint32_t>& rows, std::size_t begin,
             std::size_t end, int depth, Random& random) {
    Cell total;
    for (std::size_t i = begin; i < end; ++i) total.add(share_[rows[i]]);
    const Best best = depth < options_.max_depth && total.rows >= 2 * options_.min_rows
                          ? find(rows, begin, end, total, random)
                          : Best{};
    if (!best.found) {
      out.nodes[node].value = leaf_scale_ * total.g / (total.h + options_.lambda);
      return;
    }
    const std::uint8_t* bins = data_.bin.data() + best.feature * data_.n;
    const auto middle = std::stable_partition(rows.begin() + static_cast<std::ptrdiff_t>(begin),
                                              rows.begin() + static_cast<std::ptrdiff_t>(end),
                                              [&](auto r) { return bins[r] <= best.bin; });
    const auto at = static_cast<std::size_t>(middle - rows.begin());
    const std::size_t left = out.nodes.size();
    out.nodes.resize(left + 2);
    out.nodes[node] = {static_cast<std::int32_t>(best.feature), static_cast<std::uint32_t>(left),
                       data_.edges[best.feature][best.bin]};
    split(out, left, rows, begin, at, depth + 1, random);
    split(out, left + 1, rows, at, end, depth + 1, random);
  }

  Best find(const std::vector<std::uint32_t>& rows, std::size_t begin, std::size_t end, const Cell& total,
            Random& random) {
    Best best;
    std::size_t tried = allowed_.size();
    if (options_.features_per_split > 0 && options_.features_per_split < tried) {
      tried = options_.features_per_split;
      for (std::size_t i = 0; i < tried; ++i)
        std::swap(allowed_[i], allowed_[i + random.below(allowed_.size() - i)]);
    }
    const double whole = total.g * total.g / (total.h + options_.lambda);
    for (std::size_t a = 0; a < tried; ++a) {
      const std::size_t f = allowed_[a];
      const std::size_t last = data_.edges[f].size();
      if (last == 0) continue;
      std::fill_n(cells_.begin(), last + 1, Cell{});
      const std::uint8_t* bins = data_.bin.data() + f * data_.n;
      for (std::size_t i = begin; i < end; ++i) {
        const auto r = rows[i];
        cells_[bins[r]].add(share_[r]);
      }
      Cell left;
      for (std::size_t b = 0; b < last; ++b) {
        left.add(cells_[b]);
        if (cells_[b].rows == 0) continue;
        const double right_h = total.h - left.h, right_g = total.g - left.g;
        if (left.rows < options_.min_rows || total.rows - left.rows < options_.min_rows) continue;
        if (left.h < options_.min_h || right_h < options_.min_h) continue;
        const double gain = left.g * left.g / (left.h + options_.lambda) +
                            right_g * right_g / (right_h + options_.lambda) - whole;
        if (gain > best.gain) best = {gain, f, b, true};
      }
    }
    return best;
  }

  const Binned& data_;
  GrowOptions options_;
  std::vector<Cell> share_;  // of each row
  std::vector<std::size_t> allowed_;
  double leaf_scale_{1};
  std::array<Cell, k_max_bins + 1> cells_{};
};

std::vector<std::size_t> first_n(std::size_t n) {
  std::vector<std::size_t> out(n);
  for (std::size_t i = 0; i < n; ++i) out[i] = i;
  return out;
}

double tree_value(const Trees& model, std::uint32_t at, std::span<const double> x) {
  while (model.nodes[at].feature >= 0)
    at = model.nodes[at].left +
         (x[static_cast<std::size_t>(model.nodes[at].feature)] < model.nodes[at].value ? 0U : 1U);
  return model.nodes[at].value;
}

}  // namespace

Trees fit_forest(const TrainingRows& rows, const TreeOptions& options, std::vector<double>* out_of_bag,
                 const Execution& run) {
  const Binned data{rows};
  const std::size_t n = rows.n();
  std::size_t per_split = options.features_per_split;
  if (per_split == 0)
    per_split =
        std::max<std::size_t>(1, static_cast<std::size_t>(std::sqrt(static_cast<double>(rows.d)) + 0.5));
  GrowOptions grow{options.max_depth, 0, 1e-12, std::max(1.0, options.leaf_share * static_cast<double>(n)),
                   per_split};
  Grower grower{data, grow};
  std::vector<double> g(n), h(rows.w.begin(), rows.w.end()), times(n), sum(n, 0), count(n, 0);
  for (std::size_t i = 0; i < n; ++i) g[i] = rows.w[i] * rows.y[i];
  Trees model;
  model.scale = 1.0 / options.trees;
  Random random{options.seed};
  for (int t = 0; t < options.trees && !run.cancelled(); ++t) {
    std::fill(times.begin(), times.end(), 0.0);
    for (std::size_t i = 0; i < n; ++i) times[random.below(n)] += 1;
    std::vector<std::uint32_t> used;
    for (std::size_t i = 0; i < n; ++i)
      if (times[i] > 0) used.push_back(static_cast<std::uint32_t>(i));
    grower.grow(model, used, g, h, times, first_n(rows.d), 1.0, random);
    if (!out_of_bag) continue;
    for (std::size_t i = 0; i < n; ++i)
      if (times[i] == 0) {
        sum[i] += tree_value(model, model.roots.back(), rows.row(i));
        count[i] += 1;
      }
  }
  if (out_of_bag) {
    out_of_bag->resize(n);
    for (std::size_t i = 0; i < n; ++i)
      (*out_of_bag)[i] = count[i] > 0 ? sum[i] / count[i] : std::numeric_limits<double>::quiet_NaN();
  }
  return model;
}

Trees fit_boosted(const TrainingRows& rows, const BoostOptions& options, const Execution& run) {
  const Binned data{rows};
  const std::size_t n = rows.n();
  Grower grower{data, {options.depth, options.lambda, options.min_child_weight, options.min_rows, 0}};
  double sum_w = 0, sum_wy = 0;
  for (std::size_t i = 0; i < n; ++i) {
    sum_w += rows.w[i];
    sum_wy += rows.w[i] * rows.y[i];
  }
  const double mean = sum_wy / sum_w;
  Trees model;
  const double rate = std::clamp(mean, 0.01, 0.99);
  model.base = options.classification ? std::log(rate / (1 - rate)) : mean;
  std::vector<double> f(n, model.base), g(n), h(n);
  const std::vector<double> once(n, 1.0);
  Random random{options.seed};
  const auto columns = std::max<std::size_t>(
      1, static_cast<std::size_t>(std::lround(options.column_share * static_cast<double>(rows.d))));
  std::vector<std::uint32_t> order;
  for (int round = 0; round < options.rounds && !run.cancelled(); ++round) {
    for (std::size_t i = 0; i < n; ++i) {
      const double p = options.classification ? sigmoid(f[i]) : 0;
      g[i] = rows.w[i] * (options.classification ? rows.y[i] - p : rows.y[i] - f[i]);
      h[i] = rows.w[i] * (options.classification ? std::max(p * (1 - p), 1e-9) : 1.0);
    }
    order.clear();
    for (std::size_t i = 0; i < n; ++i)
      if (random.uniform() < options.row_share) order.push_back(static_cast<std::uint32_t>(i));
    if (order.empty()) order.push_back(static_cast<std::uint32_t>(random.below(n)));
    auto allowed = first_n(rows.d);
    random.shuffle(allowed);
    allowed.resize(columns);
    grower.grow(model, order, g, h, once, std::move(allowed), options.learning_rate, random);
    for (std::size_t i = 0; i < n; ++i) f[i] += tree_value(model, model.roots.back(), rows.row(i));
  }
  return model;
}

}  // namespace anchord::ml
