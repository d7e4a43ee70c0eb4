#include "api/learning/freeze_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "api/formats/names_alike.hpp"
#include "api/learning/split_leak.hpp"
#include "core/base/to_wire.hpp"
#include "core/ml/dataset.hpp"
#include "core/ml/random.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;
using nlos::k_feature_count;

/// What loggers write where there is no level, stored before it was refused.
void drop_impossible_levels(std::vector<DatasetRow>& rows, std::map<std::string, std::size_t>& dropped) {
  const auto n = std::erase_if(rows, [](const DatasetRow& row) { return !impossible_level(row).empty(); });
  if (n > 0) dropped["a level outside -200 to 50 dBm"] += n;
}

/// Measurements whose range is far off the others of their setting.
std::vector<DatasetRow> without_outliers(std::vector<DatasetRow> rows,
                                         std::map<std::string, std::size_t>& dropped) {
  std::map<std::string, std::uint32_t> settings;
  std::vector<double> range_m;
  std::vector<std::uint32_t> placement;
  for (const auto& row : rows) {
    range_m.push_back(row.range_m());
    placement.push_back(
        settings.try_emplace(row.campaign + "\n" + row.setting, static_cast<std::uint32_t>(settings.size()))
            .first->second);
  }
  const auto faults = ml::range_outliers(range_m, placement);
  if (faults.empty()) return rows;
  dropped["range more than 8 MAD off the median of its setting"] += faults.size();
  const std::set<std::size_t> faulty(faults.begin(), faults.end());
  std::vector<DatasetRow> kept;
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (!faulty.contains(i)) kept.push_back(std::move(rows[i]));
  return kept;
}

/// The spreads (the dissertation's Std among them) come with means as with medians.
nlos::FeatureVector mean_of(const std::vector<nlos::FeatureVector>& all) {
  nlos::FeatureVector out;
  const auto spreads = nlos::aggregate_at_rest(all);
  for (const auto f :
       {nlos::Feature::log_range_spread, nlos::Feature::log_fp_spread, nlos::Feature::log_rx_minus_fp_spread})
    out.set(f, spreads.get(f));
  for (std::size_t f = 0; f < k_feature_count; ++f) {
    double sum = 0;
    bool every = true;
    for (const auto& one : all) {
      every = every && one.present.test(f);
      sum += one.values[f];
    }
    if (every) out.set(static_cast<nlos::Feature>(f), sum / static_cast<double>(all.size()));
  }
  return out;
}

/// Mean or median of what repeats give; equal values stay what they are, to the last digit.
double middle_of(std::vector<double> values, Aggregation how) {
  std::sort(values.begin(), values.end());
  if (values.front() == values.back()) return values.front();
  const std::size_t n = values.size();
  if (how == Aggregation::median)
    return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(n);
}

using Repeats = std::vector<const DatasetRow*>;

/// One row of the repeats of a setting: the truth of all of them, the class of most.
DatasetRow one_of(const Repeats& repeats, Aggregation how) {
  DatasetRow out = *repeats.front();
  out.repeats = repeats.size();
  std::vector<nlos::FeatureVector> features;
  std::vector<double> truth;
  std::size_t los = 0, labelled = 0;
  for (const auto* row : repeats) {
    features.push_back(row->features);
    if (row->true_range_m) truth.push_back(*row->true_range_m);
    labelled += row->los ? 1 : 0;
    los += row->los.value_or(false) ? 1 : 0;
  }
  out.features = how == Aggregation::mean ? mean_of(features) : nlos::aggregate_at_rest(features);
  out.true_range_m = truth.size() == repeats.size() ? std::optional{middle_of(truth, how)} : std::nullopt;
  out.los = labelled > 0 ? std::optional{2 * los > labelled} : std::nullopt;
  for (std::size_t c = 0; c < out.registers.size(); ++c) {
    std::vector<double> values;
    for (const auto* row : repeats)
      if (!std::isnan(row->registers[c])) values.push_back(row->registers[c]);
    out.registers[c] = values.size() == repeats.size() ? middle_of(std::move(values), how)
                                                       : std::numeric_limits<double>::quiet_NaN();
  }
  return out;
}

std::vector<DatasetRow> aggregated(const std::vector<DatasetRow>& rows, Aggregation how) {
  std::map<std::string, std::size_t> at;
  std::vector<Repeats> settings;
  for (const auto& row : rows) {
    const auto [it, fresh] = at.try_emplace(row.campaign + "\n" + row.setting, settings.size());
    if (fresh) settings.emplace_back();
    settings[it->second].push_back(&row);
  }
  std::vector<DatasetRow> out;
  for (const auto& repeats : settings) out.push_back(one_of(repeats, how));
  return out;
}

Result<void> split(const FreezeOptions& how, std::vector<DatasetRow>& rows) {
  std::set<std::string> places;
  for (const auto& row : rows) places.insert(place_name(row, how.split_by));
  std::set<std::string> test(how.test.begin(), how.test.end());
  for (const auto& name : test) {
    if (!places.contains(name))
      return make_error(Errc::not_found, "there is no " + std::string(place_word(how.split_by)) + " named " +
                                             name + " among the rows");
  }
  if (test.empty() && how.test_share > 0) {
    std::vector<std::string> order(places.begin(), places.end());
    std::vector<std::uint32_t> index(order.size());
    for (std::uint32_t i = 0; i < index.size(); ++i) index[i] = i;
    ml::Random random{how.seed};
    random.shuffle(index);
    const auto n = static_cast<std::size_t>(std::ceil(how.test_share * static_cast<double>(order.size())));
    for (std::size_t i = 0; i < std::min(n, order.size()); ++i) test.insert(order[index[i]]);
  }
  for (auto& row : rows) row.test = test.contains(place_name(row, how.split_by));
  return boost::outcome_v2::success();
}

struct Part {
  std::size_t rows{}, los{}, nlos{};
  std::set<std::string> settings, environments, campaigns;
  void take(const DatasetRow& row) {
    ++rows;
    if (row.los) ++(*row.los ? los : nlos);
    settings.insert(place_name(row, Place::setting));
    environments.insert(place_name(row, Place::environment));
    campaigns.insert(row.campaign);
  }
  Ordered json() const {
    return {{"rows", rows},
            {"los", los},
            {"nlos", nlos},
            {"settings", settings.size()},
            {"environments", environments},
            {"campaigns", campaigns}};
  }
};

std::vector<std::string> shared(const std::set<std::string>& a, const std::set<std::string>& b) {
  std::vector<std::string> out;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(out));
  if (out.size() > 100) out.resize(100);
  return out;
}

std::string split_report_json(const DatasetTable& table, Place split_by,
                              const std::map<std::string, std::size_t>& dropped) {
  Part train, test;
  for (const auto& row : table.rows) (row.test ? test : train).take(row);
  const auto environments = shared(train.environments, test.environments),
             campaigns = shared(train.campaigns, test.campaigns),
             settings = shared(train.settings, test.settings);
  const auto duplicates = copies(table);
  Ordered warnings = Ordered::array();
  if (duplicates > 0)
    warnings.push_back(
        std::to_string(duplicates) +
        " held-out rows are in the training part too, with the same numbers: figures on them promise too "
        "much, and the gate of models leaves them out");
  if (test.rows == 0) warnings.push_back("no part is held out: the figures come from cross-validation only");
  if (!campaigns.empty())
    warnings.push_back("train and test have a campaign in common: the same radios, perhaps the same day");
  std::vector<std::string> environments_named, settings_named;
  for (const auto* part : {&train, &test}) {
    environments_named.insert(environments_named.end(), part->environments.begin(), part->environments.end());
    settings_named.insert(settings_named.end(), part->settings.begin(), part->settings.end());
  }
  for (auto& warning : names_alike("environments", environments_named))
    warnings.push_back(std::move(warning));
  for (auto& warning : names_alike("settings", settings_named)) warnings.push_back(std::move(warning));
  Ordered faults = Ordered::array();
  for (const auto& [reason, n] : dropped) faults.push_back({{"reason", reason}, {"count", n}});
  const bool leak = !environments.empty() || !settings.empty() || duplicates > 0;
  return to_wire(
      Ordered{{"leak", leak},
              {"split_by", place_word(split_by)},
              {"train", train.json()},
              {"test", test.json()},
              {"shared", {{"environments", environments}, {"campaigns", campaigns}, {"settings", settings}}},
              {"duplicate_rows", duplicates},
              {"dropped", faults},
              {"warnings", warnings}});
}

FrozenDataset counted(DatasetTable table, Place split_by, const std::map<std::string, std::size_t>& dropped) {
  FrozenDataset out;
  out.table = std::move(table);
  for (const auto& row : out.table.rows) ++(row.test ? out.n_test : out.n_train);
  out.report_json = split_report_json(out.table, split_by, dropped);
  return out;
}

}  // namespace

FrozenDataset frozen_before(DatasetTable table) { return counted(std::move(table), Place::environment, {}); }

std::string split_report_text(const FrozenDataset& set) {
  const auto report = Ordered::parse(set.report_json);
  std::string out;
  for (const char* name : {"train", "test"}) {
    const auto& part = report.at(name);
    out += std::string(name) + (name[1] == 'e' ? "  " : " ") + to_wire(part.at("rows")) + " rows (" +
           to_wire(part.at("los")) + " LOS, " + to_wire(part.at("nlos")) + " NLOS), " +
           to_wire(part.at("settings")) + " settings, " + std::to_string(part.at("environments").size()) +
           " environments\n";
  }
  for (const auto& one : report.at("dropped"))
    out += "dropped " + to_wire(one.at("count")) + ": " + one.at("reason").get<std::string>() + "\n";
  const auto& shared = report.at("shared");
  out += std::string("leak  ") + (report.at("leak").get<bool>() ? "YES" : "none") + ": " +
         std::to_string(shared.at("environments").size()) + " environments and " +
         std::to_string(shared.at("settings").size()) + " settings on both sides, " +
         to_wire(report.at("duplicate_rows")) + " rows equal to rows of the other side\n";
  for (const auto& warning : report.at("warnings")) out += "note  " + warning.get<std::string>() + "\n";
  return out;
}

Result<FrozenDataset> freeze_rows(DatasetTable table, const FreezeOptions& how,
                                  std::map<std::string, std::size_t> dropped) {
  auto& rows = table.rows;
  drop_impossible_levels(rows, dropped);
  if (how.filter_faults) rows = without_outliers(std::move(rows), dropped);
  if (how.aggregation != Aggregation::none) rows = aggregated(rows, how.aggregation);
  if (rows.empty()) return make_error(Errc::too_few_observations, "no labelled measurement matches");
  BOOST_OUTCOME_TRYV(split(how, rows));
  auto out = counted(std::move(table), how.split_by, dropped);
  if (out.n_train == 0)
    return make_error(Errc::too_few_observations, "every place is held out: nothing is left to train on");
  return out;
}

}  // namespace anchord::api
