#include "api/learning/dataset_table.hpp"

#include <algorithm>
#include <array>
#include <bitset>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "api/formats/csv_record.hpp"
#include "api/wire/row_limits.hpp"
#include "core/base/sha256.hpp"
#include "core/base/text.hpp"
#include "core/ml/plausible.hpp"

namespace anchord::api {
namespace {

using nlos::Feature;
using nlos::k_feature_count;

constexpr std::array<std::string_view, 7> k_columns{"campaign", "environment",  "setting", "split",
                                                    "los",      "true_range_m", "repeats"};
constexpr std::string_view k_formula = "=+-@\t\r";
/// Features that name the version in the first line, so that other formulas are never mixed in.
constexpr std::string_view k_version_column = "feature_set";
constexpr std::string_view k_truth_sigma = "truth_sigma_m";
constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();

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

std::string plain(std::string_view cell) {
  if (cell.size() > 1 && cell.front() == '\'' &&
      (k_formula.find(cell[1]) != std::string_view::npos || cell[1] == '\''))
    cell.remove_prefix(1);
  return std::string(cell);
}

std::optional<double> number(std::string_view cell) {
  double value = 0;
  const auto [end, status] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (status != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

Error bad(std::size_t line, const std::string& what) {
  return make_error(Errc::bad_frame, "line " + std::to_string(line) + ": " + what);
}

/// What stands after the fixed columns, in any order.
struct Column {
  std::string name;
  std::optional<Feature> feature{};
  bool truth_sigma{false};
  std::size_t slot{};  ///< of the registers, which keep their own order
};

Result<std::vector<Column>> columns_of(const std::vector<std::string_view>& header,
                                       std::vector<std::string>& registers) {
  std::vector<Column> out;
  std::set<std::string> seen;
  for (std::size_t c = k_columns.size() + 1; c < header.size(); ++c) {
    const std::string name(header[c]);
    if (!seen.insert(name).second) return bad(1, "column " + to_utf8(name, 60) + " occurs twice");
    out.push_back({name, nlos::feature_of(header[c]), header[c] == k_truth_sigma, 0});
  }
  for (const auto name : register_columns())
    if (seen.erase(std::string(name)) > 0) registers.emplace_back(name);
  for (auto& column : out) {
    const auto at = std::find(registers.begin(), registers.end(), column.name);
    if (!column.feature && !column.truth_sigma && at == registers.end())
      return bad(1, "no feature is named " + to_utf8(column.name, 60));
    column.slot = static_cast<std::size_t>(at - registers.begin());
  }
  return out;
}

}  // namespace

const std::vector<std::string_view>& register_columns() {
  static const std::vector<std::string_view> k_registers{
      "fp_amp1", "fp_amp2", "fp_amp3",      "cir_pwr", "std_noise", "max_noise",
      "rxpacc",  "fp_raw",  "cir_kurtosis", "grp1",    "grp2",      "grp3",
      "grp4",    "grp5",    "grp6",         "grp7",    "grp8"};
  return k_registers;
}

bool is_dataset_csv(std::string_view text) { return text.starts_with("feature_set,campaign,environment,"); }

std::string_view impossible_level(const DatasetRow& row) {
  for (const auto feature : {Feature::rx_dbm, Feature::fp_dbm}) {
    const auto level = row.features.get(feature);
    if (level && !row_limits::k_dbm.hold(*level)) return nlos::feature_name(feature);
  }
  return {};
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
  std::vector<std::size_t> kept;
  for (std::size_t c = 0; c < registers.size(); ++c) {
    if (std::all_of(rows.begin(), rows.end(), [c](const auto& row) { return std::isnan(row.registers[c]); }))
      continue;
    kept.push_back(c);
    out.append(",").append(registers[c]);
  }
  const bool truth_sigma =
      std::any_of(rows.begin(), rows.end(), [](const auto& row) { return row.truth_sigma_m.has_value(); });
  if (truth_sigma) out.append(",").append(k_truth_sigma);
  out += '\n';
  for (const auto& row : rows) {
    out += feature_set;
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
    for (const auto c : kept) {
      out += ',';
      if (!std::isnan(row.registers[c])) put_number(out, row.registers[c]);
    }
    if (truth_sigma) out += ',';
    if (row.truth_sigma_m) put_number(out, *row.truth_sigma_m);
    out += '\n';
  }
  return out;
}

Result<DatasetTable> DatasetTable::parse(std::string_view text) {
  CsvRecord record({',', false});  // names are kept as they are: the digest is of this very text
  const auto& cells = record.cells();
  const auto next = [&](std::size_t line) -> Result<bool> {
    auto more = record.take(text);
    if (!more) return bad(line, more.error().message);
    return more;
  };
  BOOST_OUTCOME_TRY(const bool any, next(1));
  if (!any) return bad(1, "a header line is needed");
  if (cells.size() < k_columns.size() + 1 || cells[0] != k_version_column ||
      !std::equal(k_columns.begin(), k_columns.end(), cells.begin() + 1))
    return bad(1,
               "the columns must begin with feature_set,campaign,environment,setting,split,los,"
               "true_range_m,repeats");
  DatasetTable out;
  BOOST_OUTCOME_TRY(const auto columns, columns_of(cells, out.registers));
  const std::size_t width = cells.size();
  for (std::size_t line = 2;; ++line) {
    BOOST_OUTCOME_TRY(const bool more, next(line));
    if (!more) break;
    if (cells.size() == 1 && cells[0].empty()) continue;
    if (cells.size() != width)
      return bad(line, std::to_string(cells.size()) + " cells, the header has " + std::to_string(width));
    if (out.rows.empty()) out.feature_set = cells[0];
    const auto other = std::find_if(columns.begin(), columns.end(),
                                    [&](const Column& c) { return !nlos::means_the_same(cells[0], c.name); });
    if (cells[0] != out.feature_set || other != columns.end())
      return make_error(
          Errc::unsupported,
          "line " + std::to_string(line) + ": " +
              (other != columns.end() ? other->name + " of the version " : "features of the version ") +
              to_utf8(cells[0], 60) + ", this program has " + std::string(nlos::k_feature_set_version) +
              ": freeze the data set again");
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
    row.registers.assign(out.registers.size(), k_nan);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const auto& cell = cells[k_columns.size() + 1 + c];
      if (cell.empty()) continue;
      const auto value = number(cell);
      if (!value) return bad(line, columns[c].name + " must be a number");
      if (columns[c].truth_sigma && !(*value >= 0 && *value <= 100))
        return bad(line, "truth_sigma_m must be 0 to 100 m");
      if (columns[c].truth_sigma)
        row.truth_sigma_m = *value;
      else if (columns[c].feature)
        row.features.set(*columns[c].feature, *value);
      else
        row.registers[columns[c].slot] = *value;
    }
    if (const auto name = impossible_level(row); !name.empty())
      return bad(line,
                 std::string(name) + " must be -200 to 50 dBm; leave the cell empty where there is no level");
    if (row.features.get(Feature::range_m) && !(row.range_m() > 0))
      return bad(line, "range_m must be above 0");
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

namespace {

/// Where a feature of the data comes from: computed, or a register.
struct Source {
  std::string name;
  std::optional<Feature> feature{};
  std::size_t column{};
  std::optional<double> of(const DatasetRow& row) const {
    if (feature) return row.features.get(*feature);
    return std::isnan(row.registers[column]) ? std::nullopt : std::optional{row.registers[column]};
  }
};

/// Of no names, the features that flights can have and nearly every row has. `dropped`: which others there
/// are, with the rows that lack them.
Result<std::vector<Source>> sources_of(const DatasetTable& table, const std::vector<std::string>& names,
                                       std::map<std::string, std::size_t>& dropped) {
  std::vector<Source> out;
  for (const auto& name : names) {
    const auto feature = nlos::feature_of(name);
    const auto column = std::find(table.registers.begin(), table.registers.end(), name);
    if (!feature && column == table.registers.end())
      return make_error(Errc::not_found, "the data set has no feature named " + name);
    out.push_back({name, feature, static_cast<std::size_t>(column - table.registers.begin())});
  }
  for (std::size_t f = 0; names.empty() && f < k_feature_count; ++f) {
    if (!nlos::live_ranges_have(static_cast<Feature>(f))) continue;
    std::size_t present = 0;
    for (const auto& row : table.rows) present += row.features.present.test(f) ? 1 : 0;
    // A feature that one row in a hundred lacks is worth that row.
    const auto feature = static_cast<Feature>(f);
    if (present > 0 && 100 * present >= 99 * table.rows.size())
      out.push_back({std::string(nlos::feature_name(feature)), feature, 0});
    else if (present > 0)
      dropped[std::string(nlos::feature_name(feature)) + " is not used as a feature: rows without it"] =
          table.rows.size() - present;
  }
  return out;
}

}  // namespace

std::string not_for_live(const DatasetTable& table) {
  std::size_t most = 1;
  for (const auto& row : table.rows) most = std::max(most, row.repeats);
  if (most == 1) return {};
  return "the rows are means or medians of up to " + std::to_string(most) +
         " rangings, but a live range is a single one: train on a data set with aggregation none";
}

LearningWish wish_of(ml::Task task, const DatasetTable& table) {
  LearningWish wish;
  wish.need_label = task != ml::Task::bias;
  wish.need_truth = task != ml::Task::nlos_id;
  if (task == ml::Task::los_bias) wish.only_los = true;
  if (task == ml::Task::nlos_bias) wish.only_los = false;
  // Classes help where every row has one; without any, the bias of all is learned as one.
  if (task == ml::Task::bias)
    wish.need_label = std::any_of(table.rows.begin(), table.rows.end(),
                                  [](const DatasetRow& row) { return row.los.has_value(); });
  return wish;
}

Result<LearningRows> learning_rows(const DatasetTable& table, const LearningWish& wish) {
  LearningRows out;
  BOOST_OUTCOME_TRY(const auto sources, sources_of(table, wish.features, out.dropped));
  for (const auto& source : sources) out.data.features.push_back(source.name);
  // A place with rows on both sides of the split is two places, so that training never sees a test row.
  std::map<std::string, std::pair<bool, bool>> sides;
  for (const auto& row : table.rows) {
    auto& side = sides[place_name(row, wish.group_by)];
    (row.test ? side.second : side.first) = true;
  }
  std::map<std::string, std::uint32_t> groups, placements;
  std::set<std::string> held_out;
  std::vector<std::optional<double>> truth_sigma_m;
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
    if (wish.need_truth && !row.features.get(Feature::range_m)) {
      drop("no measured range");
      continue;
    }
    if (wish.need_truth && std::abs(row.range_m() - *row.true_range_m) > ml::k_most_bias_m) {
      drop("a range more than 100 m off its true distance");
      continue;
    }
    const auto lacking =
        std::find_if(sources.begin(), sources.end(), [&](const Source& one) { return !one.of(row); });
    if (lacking != sources.end()) {
      drop("no " + lacking->name);
      continue;
    }
    for (const auto& source : sources) out.data.x.push_back(*source.of(row));
    if (wish.need_label) out.data.los.push_back(*row.los ? 1 : 0);
    if (wish.need_truth) out.data.bias_m.push_back(row.range_m() - *row.true_range_m);
    out.data.weight.push_back(1);
    truth_sigma_m.push_back(row.truth_sigma_m);
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
  ml::weigh_by_truth(out.data, truth_sigma_m);
  out.held_out.assign(held_out.begin(), held_out.end());
  return out;
}

}  // namespace anchord::api
