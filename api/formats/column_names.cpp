#include "api/formats/column_names.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <unordered_map>
#include <utility>

#include "core/base/text.hpp"

namespace anchord::api::columns {
namespace {

constexpr std::array<std::pair<std::string_view, double>, 3> k_lengths{
    {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1.0}}};
constexpr std::array<std::string_view, 11> k_no_lengths{"ft", "feet", "foot", "in", "inch", "yd",
                                                        "ns", "ps",   "us",   "ms", "km"};

/// "range_ft", "Range [ft]", "range(ft)": ft.
std::string last_word(std::string_view name) {
  std::string word;
  for (const char c : name) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    if (letter)
      word += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    else if (c == '_' || c == ' ' || c == '[' || c == '(' || c == '.' || c == '/')
      word.clear();
  }
  return word;
}

std::string quoted(std::string_view name) { return '"' + to_utf8(name, 60) + '"'; }

/// The unit in which numbers of `name` would have to be, for the ratio to be one.
std::string remedy(std::string_view name, double factor) {
  const double unit = metres_per_unit(name).value_or(1.0) * factor;
  for (const auto& [word, metres] : k_lengths)
    if (std::abs(unit / metres - 1) < 0.01)
      return quoted(name) + " is in " + std::string(word) + ", rename it to range_" + std::string(word);
  return {};
}

struct Numbered {
  std::string_view stem;
  std::size_t number{};
};
std::optional<Numbered> numbered(std::string_view name) {
  const auto at = name.find_last_not_of("0123456789");
  const auto digits = name.size() - (at == std::string_view::npos ? 0 : at + 1);
  if (at == std::string_view::npos || digits == 0 || digits > 6) return std::nullopt;
  std::size_t number = 0;
  for (const char c : name.substr(at + 1)) number = 10 * number + static_cast<std::size_t>(c - '0');
  return Numbered{name.substr(0, at + 1), number};
}

}  // namespace

std::string bare_name(std::string_view name) {
  std::string out;
  for (const char c : name) {
    if (c >= 'A' && c <= 'Z')
      out += static_cast<char>(c - 'A' + 'a');
    else if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'))
      out += c;
  }
  return out;
}

std::string_view known_name(std::string_view name) {
  static const auto k_known = [] {
    std::unordered_map<std::string, std::string_view> out;
    for (const auto* names :
         {&k_range,       &k_distance, &k_truth,        &k_label,        &k_rx,        &k_fp,
          &k_f1,          &k_f2,       &k_f3,           &k_cir_power,    &k_count,     &k_std_noise,
          &k_max_noise,   &k_fp_index, &k_heading,      &k_truth_sd,     &k_site_name, &k_environment,
          &k_site_height, &k_seconds,  &k_milliseconds, &k_microseconds, &k_material,  &k_thickness})
      for (const auto one : *names) out.try_emplace(bare_name(one), one);
    return out;
  }();
  const auto found = k_known.find(bare_name(name));
  return found == k_known.end() ? std::string_view{} : found->second;
}

std::optional<std::size_t> first_of(std::span<const std::string> header, const Names& names) {
  for (const auto name : names)
    if (const auto at = std::ranges::find(header, name); at != header.end())
      return static_cast<std::size_t>(at - header.begin());
  for (const auto name : names) {
    const auto wanted = bare_name(name);
    for (std::size_t i = 0; i < header.size(); ++i)
      if (bare_name(header[i]) == wanted) return i;
  }
  return std::nullopt;
}

std::optional<double> metres_per_unit(std::string_view name) {
  const auto word = last_word(name);
  if (std::ranges::find(k_no_lengths, word) != k_no_lengths.end()) return std::nullopt;
  const auto plain = bare_name(name);
  return plain.ends_with("mm") ? 1e-3 : plain.ends_with("cm") ? 1e-2 : 1.0;
}

double in_metres(double length, std::string_view name) {
  // Divided: a thousandth is no binary number, and 5100 times it is not 5.1.
  const double metres = metres_per_unit(name).value_or(1);
  return metres < 1 ? length / std::round(1 / metres) : length;
}

std::vector<std::string> in_runs(std::span<const std::string> names) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < names.size();) {
    std::size_t end = i + 1;
    if (const auto first = numbered(names[i]))
      for (; end < names.size(); ++end) {
        const auto next = numbered(names[end]);
        if (!next || next->stem != first->stem || next->number != first->number + (end - i)) break;
      }
    if (end - i > 3)
      out.push_back(names[i] + " to " + names[end - 1] + " (" + std::to_string(end - i) + " columns)");
    else
      out.insert(out.end(), names.begin() + static_cast<std::ptrdiff_t>(i),
                 names.begin() + static_cast<std::ptrdiff_t>(end));
    i = end;
  }
  return out;
}

std::string unit_conflict(const Ratios& ratios, std::string_view range, std::string_view truth) {
  if (ratios.values.empty()) return {};
  auto values = ratios.values;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  const double ratio = *middle;
  for (const double factor : {100.0, 1000.0, 0.01, 0.001}) {
    if (std::abs(ratio / factor - 1) > 0.2) continue;
    std::array<char, 80> text{};
    std::snprintf(text.data(), text.size(), "%.3g times", ratio);
    std::string out = quoted(range) + " is impossible beside " + quoted(truth) + ": " + text.data() +
                      " the truth, by the median of " + std::to_string(values.size()) +
                      " rows, so one of the two is in another unit than its name says";
    const auto of_range = remedy(range, 1 / factor);
    auto of_truth = remedy(truth, factor);
    if (const auto at = of_truth.rfind("range_"); at != std::string::npos)
      of_truth.replace(at, 6, "true_distance_");
    for (const auto& one : {of_range, of_truth})
      if (!one.empty()) out += "; if " + one;
    return out;
  }
  return {};
}

std::string implausible_ranges(std::size_t implausible, std::size_t of) {
  if (20 * implausible <= of) return {};
  return std::to_string(implausible) + " of " + std::to_string(of) +
         " measured ranges are more than twice or less than half of the true one, or farther "
         "than a radio reaches: are both in metres? No server promotes a model of them";
}

}  // namespace anchord::api::columns
