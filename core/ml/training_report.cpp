#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <unordered_map>

#include "core/ml/random.hpp"
#include "core/ml/training.hpp"

namespace anchord::ml {
namespace {

void count_side(const Dataset& data, const std::vector<std::size_t>& rows, std::size_t& n,
                std::size_t& placements, std::size_t& places) {
  std::set<std::uint32_t> placement, place;
  for (const auto i : rows) {
    placement.insert(data.placement[i]);
    place.insert(data.group[i]);
  }
  n = rows.size();
  placements = placement.size();
  places = place.size();
}

std::size_t shared_placements(const Dataset& data) {
  std::unordered_map<std::uint32_t, std::uint32_t> home;
  std::set<std::uint32_t> shared;
  for (std::size_t i = 0; i < data.rows(); ++i) {
    const auto [at, fresh] = home.try_emplace(data.placement[i], data.group[i]);
    if (!fresh && at->second != data.group[i]) shared.insert(data.placement[i]);
  }
  return shared.size();
}

// Bytes of everything a model may see of a row and of its answers.
std::string fingerprint(const Dataset& data, std::size_t i) {
  std::string out;
  const auto add = [&out](double value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    out.append(bytes, sizeof value);
  };
  for (const double value : data.row(i)) add(value);
  if (data.has_truth()) add(data.bias_m[i]);
  if (data.labelled()) out.push_back(static_cast<char>(data.los[i]));
  return out;
}

std::size_t duplicate_rows(const Dataset& data) {
  std::unordered_map<std::string, std::uint32_t> seen;
  std::size_t out = 0;
  for (std::size_t i = 0; i < data.rows(); ++i) {
    const auto [at, fresh] = seen.try_emplace(fingerprint(data, i), data.group[i]);
    if (!fresh && at->second != data.group[i]) ++out;
  }
  return out;
}

}  // namespace

SplitReport split_report(const Dataset& data, const std::vector<std::size_t>& train,
                         const std::vector<std::size_t>& test) {
  SplitReport out;
  count_side(data, train, out.train_rows, out.train_placements, out.train_places);
  count_side(data, test, out.test_rows, out.test_placements, out.test_places);
  std::set<std::uint32_t> places;
  for (const auto i : test) places.insert(data.group[i]);
  for (const auto id : places) out.test_place_names.push_back(place_name(data, id));
  out.shared_placements = shared_placements(data);
  out.duplicate_rows = duplicate_rows(data);
  out.leak = out.shared_placements > 0 || out.duplicate_rows > 0;
  return out;
}

ThresholdReport threshold_report(const Dataset& data, std::span<const double> p_los, double threshold,
                                 std::optional<double> max_fpr, std::uint64_t seed) {
  ThresholdReport out;
  const auto confusion = confusion_at(p_los, data.los, threshold);
  out.threshold = threshold;
  out.max_fpr = max_fpr;
  out.fpr = confusion.fpr();
  out.accuracy = confusion.accuracy();
  out.accuracy_at_half = confusion_at(p_los, data.los, 0.5).accuracy();

  struct Place {
    double wrong{}, nlos{};
  };
  std::map<std::uint32_t, Place> by_place;
  for (std::size_t i = 0; i < data.rows(); ++i) {
    if (data.los[i]) continue;
    auto& place = by_place[data.group[i]];
    place.nlos += 1;
    place.wrong += p_los[i] >= threshold ? 1 : 0;
  }
  std::vector<Place> places;
  for (const auto& [id, place] : by_place) places.push_back(place);
  out.places = places.size();
  if (places.empty()) return out;
  // Places are what is drawn anew when the model meets another building, so places are resampled.
  constexpr int k_draws = 1000;
  Random random{seed};
  std::vector<double> drawn;
  for (int r = 0; r < k_draws; ++r) {
    Place sum;
    for (std::size_t k = 0; k < places.size(); ++k) {
      const auto& place = places[random.below(places.size())];
      sum.wrong += place.wrong;
      sum.nlos += place.nlos;
    }
    drawn.push_back(sum.wrong / sum.nlos);
  }
  std::sort(drawn.begin(), drawn.end());
  out.fpr_low = drawn[static_cast<std::size_t>(0.025 * k_draws)];
  out.fpr_high = drawn[static_cast<std::size_t>(0.975 * k_draws) - 1];
  return out;
}

}  // namespace anchord::ml
