#include "api/learning/dataset_table.hpp"

#include <algorithm>
#include <array>
#include <bitset>
#include <charconv>
#include <cmath>
#include <set>

#include "core/base/sha256.hpp"

namespace anchord::api {
namespace {

using nlos::Feature;
using nlos::k_feature_count;

constexpr std::array<std::string_view, 7> k_columns{"campaign", "environment",  "setting", "split",
                                                    "los",      "true_range_m", "repeats"};
constexpr std::string_view k_formula = "=+-@\t\r";
/// Features that name the version in the first line, so that other formulas are never mixed in.
constexpr std::string_view k_version_column = "feature_set";

void put_number(std::string& out, double value) {
  std::array<char, 40> text{};
  const auto [end, status] = std::to_chars(text.data(), text.data() + text.size(), value == 0 ? 0.0 : value);
  if (status == std::errc{}) out.append(text.data(), end);
}

void put_text(std::string& out, std::string_view text) {
  const bool formula =
      !text.empty() && (k_formula.find(text.front()) != std::string_view::npos || text.front() == '\'');
  const bool quoted = text.find_first_of(",\"\r\n") != std::string_view::npos;
  if (quoted) out += '"';
  if (formula) out += '\'';
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  if (quoted) out += '"';
}

/// One record; false at the end. Quotes may hold line ends.
bool next_record(std::string_view& text, std::vector<std::string>& cells) {
  cells.clear();
  if (text.empty()) return false;
  std::string cell;
  bool quoted = false;
  std::size_t i = 0;
  for (; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c != '"')
        cell += c;
      else if (i + 1 < text.size() && text[i + 1] == '"')
        cell += c, ++i;
      else
        quoted = false;
    } else if (c == '"' && cell.empty()) {
      quoted = true;
    } else if (c == ',') {
      cells.push_back(std::move(cell));
      cell.clear();
    } else if (c == '\n') {
      ++i;
      break;
    } else if (c != '\r') {
      cell += c;
    }
  }
  text.remove_prefix(i);
  cells.push_back(std::move(cell));
  return true;
}

std::string plain(std::string cell) {
  if (cell.size() > 1 && cell.front() == '\'' &&
      (k_formula.find(cell[1]) != std::string_view::npos || cell[1] == '\''))
    cell.erase(0, 1);
  return cell;
}

std::optional<double> number(const std::string& cell) {
  double value = 0;
  const auto [end, status] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (status != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

Error bad(std::size_t line, const std::string& what) {
  return make_error(Errc::bad_frame, "line " + std::to_string(line) + ": " + what);
}

}  // namespace

std::string_view place_word(Place place) {
  switch (place) {
    case Place::environment:
      return "environment";
    case Place::campaign:
      return "campaign";
    case Place::setting:
      return "setting";
  }
  return "environment";
}

std::optional<Place> place_of(std::string_view word) {
  if (word == "environment") return Place::environment;
  if (word == "campaign" || word == "session") return Place::campaign;
  if (word == "setting") return Place::setting;
  return std::nullopt;
}

std::string place_name(const DatasetRow& row, Place place) {
  switch (place) {
    case Place::environment:
      return row.environment.empty() ? row.campaign : row.environment;
    case Place::campaign:
      return row.campaign;
    case Place::setting:
      return row.campaign + "/" + row.setting;
  }
  return row.campaign;
}

std::string DatasetTable::csv() const {
  std::bitset<k_feature_count> used;
  for (const auto& row : rows) used |= row.features.present;
  std::string out(k_version_column);
  for (const auto column : k_columns) out.append(",").append(column);
  for (std::size_t f = 0; f < k_feature_count; ++f)
    if (used.test(f)) out.append(",").append(nlos::feature_name(static_cast<Feature>(f)));
  out += '\n';
  for (const auto& row : rows) {
    out += nlos::k_feature_set_version;
    for (const auto* text : {&row.campaign, &row.environment, &row.setting}) {
      out += ',';
      put_text(out, *text);
    }
    out += row.test ? ",test," : ",train,";
    if (row.los) out += *row.los ? '1' : '0';
    out += ',';
    if (row.true_range_m) put_number(out, *row.true_range_m);
    out += ',' + std::to_string(row.repeats);
    for (std::size_t f = 0; f < k_feature_count; ++f) {
      if (!used.test(f)) continue;
      out += ',';
      if (row.features.present.test(f)) put_number(out, row.features.values[f]);
    }
    out += '\n';
  }
  return out;
}

Result<DatasetTable> DatasetTable::parse(std::string_view text) {
  std::vector<std::string> cells;
  if (!next_record(text, cells)) return bad(1, "a header line is needed");
  if (cells.size() < k_columns.size() + 1 || cells[0] != k_version_column ||
      !std::equal(k_columns.begin(), k_columns.end(), cells.begin() + 1))
    return bad(1,
               "the columns must begin with feature_set,campaign,environment,setting,split,los,"
               "true_range_m,repeats");
  std::vector<Feature> features;
  std::set<std::string> seen;
  for (std::size_t c = k_columns.size() + 1; c < cells.size(); ++c) {
    const auto feature = nlos::feature_of(cells[c]);
    if (!feature) return bad(1, "no feature is named " + cells[c].substr(0, 60));
    if (!seen.insert(cells[c]).second) return bad(1, "column " + cells[c] + " stands twice");
    features.push_back(*feature);
  }
  const std::size_t width = cells.size();
  DatasetTable out;
  for (std::size_t line = 2; next_record(text, cells); ++line) {
    if (cells.size() == 1 && cells[0].empty()) continue;
    if (cells.size() != width)
      return bad(line, std::to_string(cells.size()) + " cells, the header has " + std::to_string(width));
    if (cells[0] != nlos::k_feature_set_version)
      return make_error(Errc::unsupported, "line " + std::to_string(line) + ": features of the version " +
                                               cells[0].substr(0, 60) + ", this program has " +
                                               std::string(nlos::k_feature_set_version));
    DatasetRow row;
    row.campaign = plain(cells[1]);
    row.environment = plain(cells[2]);
    row.setting = plain(cells[3]);
    if (cells[4] != "train" && cells[4] != "test") return bad(line, "split must be train or test");
    row.test = cells[4] == "test";
    if (!cells[5].empty()) {
      if (cells[5] != "0" && cells[5] != "1") return bad(line, "los must be 1, 0 or empty");
      row.los = cells[5] == "1";
    }
    if (!cells[6].empty()) {
      row.true_range_m = number(cells[6]);
      if (!row.true_range_m || !(*row.true_range_m > 0) || *row.true_range_m > 1e4)
        return bad(line, "true_range_m must be above 0 and at most 10 km");
    }
    const auto repeats = number(cells[7]);
    if (!repeats || *repeats < 1 || *repeats > 1e9 || *repeats != std::floor(*repeats))
      return bad(line, "repeats must be a whole number from 1");
    row.repeats = static_cast<std::size_t>(*repeats);
    for (std::size_t f = 0; f < features.size(); ++f) {
      const auto& cell = cells[k_columns.size() + 1 + f];
      if (cell.empty()) continue;
      const auto value = number(cell);
      if (!value) return bad(line, std::string(nlos::feature_name(features[f])) + " must be a number");
      row.features.set(features[f], *value);
    }
    if (!(row.range_m() > 0)) return bad(line, "range_m must be above 0");
    out.rows.push_back(std::move(row));
  }
  if (out.rows.empty()) return bad(2, "there is no row");
  return out;
}

std::string dataset_digest(std::string_view csv) {
  Sha256 sum;
  sum.add(csv);
  return sum.hex();
}

Result<LearningRows> learning_rows(const DatasetTable& table, const LearningWish& wish) {
  LearningRows out;
  std::vector<Feature> features;
  for (const auto& name : wish.features) {
    const auto feature = nlos::feature_of(name);
    if (!feature) return make_error(Errc::not_found, "there is no feature named " + name);
    features.push_back(*feature);
  }
  if (features.empty()) {
    for (std::size_t f = 0; f < k_feature_count; ++f) {
      std::size_t present = 0;
      for (const auto& row : table.rows) present += row.features.present.test(f) ? 1 : 0;
      // A feature that one row in a hundred lacks is worth that row.
      if (present > 0 && 100 * present >= 99 * table.rows.size()) features.push_back(static_cast<Feature>(f));
    }
  }
  for (const auto feature : features) out.data.features.emplace_back(nlos::feature_name(feature));
  // A place with rows on both sides of the split is two places, so that training never sees a test row.
  std::map<std::string, std::pair<bool, bool>> sides;
  for (const auto& row : table.rows) {
    auto& side = sides[place_name(row, wish.group_by)];
    (row.test ? side.second : side.first) = true;
  }
  std::map<std::string, std::uint32_t> groups, placements;
  std::set<std::string> held_out;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const auto& row = table.rows[i];
    const auto drop = [&](const std::string& why) { ++out.dropped[why]; };
    if (wish.need_label && !row.los) {
      drop("no label");
      continue;
    }
    if (wish.only_los && row.los != wish.only_los) {
      drop(*wish.only_los ? "NLOS" : "LOS");
      continue;
    }
    if (wish.need_truth && !row.true_range_m) {
      drop("no true distance");
      continue;
    }
    const auto lacking =
        std::find_if(features.begin(), features.end(), [&](Feature f) { return !row.features.get(f); });
    if (lacking != features.end()) {
      drop("no " + std::string(nlos::feature_name(*lacking)));
      continue;
    }
    for (const auto feature : features) out.data.x.push_back(*row.features.get(feature));
    if (wish.need_label) out.data.los.push_back(*row.los ? 1 : 0);
    if (wish.need_truth) out.data.bias_m.push_back(row.range_m() - *row.true_range_m);
    out.data.weight.push_back(1);
    std::string group = place_name(row, wish.group_by);
    const auto side = sides[group];
    if (row.test && side.first) group += " (test)";
    if (row.test) held_out.insert(group);
    const auto at = groups.try_emplace(group, static_cast<std::uint32_t>(groups.size()));
    if (at.second) out.data.group_names.push_back(group);
    out.data.group.push_back(at.first->second);
    out.data.placement.push_back(
        placements
            .try_emplace(row.campaign + "\n" + row.setting, static_cast<std::uint32_t>(placements.size()))
            .first->second);
    out.source.push_back(i);
  }
  if (out.source.empty()) {
    std::string why;
    for (const auto& [reason, n] : out.dropped)
      why += (why.empty() ? ": " : ", ") + std::to_string(n) + " " + reason;
    return make_error(Errc::too_few_observations, "no row of the data set can be used" + why);
  }
  out.held_out.assign(held_out.begin(), held_out.end());
  return out;
}

}  // namespace anchord::api
