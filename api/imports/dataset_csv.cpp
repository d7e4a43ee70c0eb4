#include "api/imports/dataset_csv.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>
#include <vector>

namespace anchord::api {
namespace {

void put(std::string& out, double value) {
  std::array<char, 32> text{};
  out.append(text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr);
}

// A place's name must not tear the line, and not look like a formula to a spreadsheet.
std::string safe(std::string name) {
  for (char& c : name)
    if (c == ',' || c == '\n' || c == '\r' || c == '"') c = '_';
  return name;
}

std::string_view next_line(std::string_view& text) {
  const auto end = text.find('\n');
  auto line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  while (true) {
    const auto comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

template <class T>
bool number(std::string_view text, T& value) {
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  return status == std::errc{} && end == text.data() + text.size();
}

std::string_view field(std::string_view line, std::string_view name) {
  const auto at = line.find(name);
  if (at == std::string_view::npos) return {};
  line.remove_prefix(at + name.size());
  return line.substr(0, line.find(' '));
}

Error torn(std::size_t line, const std::string& why) {
  return make_error(Errc::bad_frame, "data set, line " + std::to_string(line) + ": " + why);
}

struct Layout {
  bool los{}, bias{};
  std::size_t first_feature{};
  std::vector<std::string> features;
};

Result<Layout> layout_of(std::string_view header) {
  const auto names = cells_of(header);
  constexpr std::array<std::string_view, 5> k_first{"place", "place_id", "placement_id", "test", "weight"};
  if (names.size() < k_first.size() || !std::equal(k_first.begin(), k_first.end(), names.begin()))
    return torn(2, "the columns must begin place,place_id,placement_id,test,weight");
  Layout out;
  std::size_t at = k_first.size();
  if (at < names.size() && names[at] == "los") out.los = true, ++at;
  if (at < names.size() && names[at] == "bias_m") out.bias = true, ++at;
  out.first_feature = at;
  for (; at < names.size(); ++at) out.features.emplace_back(names[at]);
  const std::set<std::string> distinct(out.features.begin(), out.features.end());
  if (out.features.empty() || distinct.size() != out.features.size())
    return torn(2, "each feature must be a column once");
  return out;
}

}  // namespace

std::string write_dataset_csv(const ml::FrozenDataset& set) {
  const auto& d = set.data;
  std::string out = "# " + std::string{k_dataset_format} +
                    " aggregation=" + std::string{ml::aggregation_name(set.aggregation)} +
                    " digest=" + set.digest + "\nplace,place_id,placement_id,test,weight";
  if (d.labelled()) out += ",los";
  if (d.has_truth()) out += ",bias_m";
  for (const auto& name : d.features) out += "," + name;
  out += '\n';
  const std::set<std::string> test(set.test_places.begin(), set.test_places.end());
  for (std::size_t i = 0; i < d.rows(); ++i) {
    const auto place = ml::place_name(d, d.group[i]);
    out += safe(place) + "," + std::to_string(d.group[i]) + "," + std::to_string(d.placement[i]) +
           (test.contains(place) ? ",1," : ",0,");
    put(out, d.weight[i]);
    if (d.labelled()) out += d.los[i] ? ",1" : ",0";
    if (d.has_truth()) out += ',', put(out, d.bias_m[i]);
    for (const double value : d.row(i)) out += ',', put(out, value);
    out += '\n';
  }
  return out;
}

bool is_dataset_csv(std::string_view text) {
  return text.starts_with("# ") && text.substr(2).starts_with(k_dataset_format);
}

Result<ml::FrozenDataset> read_dataset_csv(std::string_view text) {
  if (!is_dataset_csv(text)) return torn(1, "not " + std::string{k_dataset_format});
  const auto first = next_line(text);
  const auto aggregation = ml::aggregation_of(field(first, "aggregation="));
  if (!aggregation) return torn(1, "no known aggregation");
  BOOST_OUTCOME_TRY(const auto layout, layout_of(next_line(text)));
  ml::Dataset d;
  d.features = layout.features;
  std::vector<std::string> test_places;
  for (std::size_t line = 3; !text.empty(); ++line) {
    const auto row = next_line(text);
    if (row.empty()) continue;
    const auto cells = cells_of(row);
    if (cells.size() != layout.first_feature + layout.features.size())
      return torn(line, std::to_string(cells.size()) + " cells");
    std::uint32_t group{}, placement{};
    double weight{};
    if (!number(cells[1], group) || !number(cells[2], placement) || group > 10'000'000)
      return torn(line, "place_id and placement_id must be whole numbers");
    if (!number(cells[4], weight) || !(weight > 0) || !std::isfinite(weight))
      return torn(line, "weight must be above zero");
    std::size_t at = 5;
    if (layout.los) {
      if (cells[at] != "0" && cells[at] != "1") return torn(line, "los must be 0 or 1");
      d.los.push_back(cells[at++] == "1" ? 1 : 0);
    }
    double value{};
    const auto finite = [&](std::string_view cell) { return number(cell, value) && std::isfinite(value); };
    if (layout.bias) {
      if (!finite(cells[at++])) return torn(line, "bias_m is no number");
      d.bias_m.push_back(value);
    }
    for (; at < cells.size(); ++at) {
      if (!finite(cells[at])) return torn(line, "\"" + std::string{cells[at]} + "\" is no number");
      d.x.push_back(value);
    }
    d.weight.push_back(weight), d.group.push_back(group), d.placement.push_back(placement);
    if (group >= d.group_names.size()) d.group_names.resize(group + std::size_t{1});
    d.group_names[group] = std::string{cells[0]};
    if (cells[3] == "1" && std::find(test_places.begin(), test_places.end(), cells[0]) == test_places.end())
      test_places.emplace_back(cells[0]);
  }
  if (d.rows() == 0) return torn(3, "no rows");
  // The rows are aggregated already; freezing them as they are gives split, leak report and digest.
  BOOST_OUTCOME_TRY(auto out, ml::freeze_as(std::move(d), *aggregation, test_places));
  if (const auto said = field(first, "digest="); !said.empty() && said != out.digest)
    return make_error(Errc::checksum_mismatch, "the data set's content has digest " + out.digest +
                                                   ", its first line says " + std::string{said});
  return out;
}

}  // namespace anchord::api
