#include "api/learning/freeze.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "api/json/reader.hpp"
#include "api/learning/range_features.hpp"
#include "core/ml/dataset.hpp"
#include "core/ml/random.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;
using nlos::k_feature_count;

constexpr std::size_t k_most_rows = 500'000;

void read_names(const Json& list, const std::string& at, std::vector<std::string>& out,
                std::vector<FieldError>& errors) {
  if (!list.is_array() || list.size() > 1000) {
    errors.push_back({at, "wrong_type", "must be an array of at most 1000 names"});
    return;
  }
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (list[i].is_string() && list[i].get_ref<const std::string&>().size() <= 200)
      out.push_back(list[i].get<std::string>());
    else
      errors.push_back({at + "/" + std::to_string(i), "wrong_type", "must be a name"});
  }
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

nlos::FeatureVector mean_of(const std::vector<nlos::FeatureVector>& all) {
  nlos::FeatureVector out;
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

std::vector<DatasetRow> aggregated(const std::vector<DatasetRow>& rows, Aggregation how) {
  std::map<std::string, std::size_t> at;
  std::vector<DatasetRow> out;
  std::vector<std::vector<nlos::FeatureVector>> features;
  for (const auto& row : rows) {
    const auto [it, fresh] = at.try_emplace(row.campaign + "\n" + row.setting, out.size());
    if (fresh) {
      out.push_back(row);
      features.emplace_back();
    }
    features[it->second].push_back(row.features);
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].repeats = features[i].size();
    out[i].features = how == Aggregation::mean ? mean_of(features[i]) : nlos::aggregate_at_rest(features[i]);
  }
  return out;
}

Result<void> split(const DatasetQuery& query, std::vector<DatasetRow>& rows) {
  std::set<std::string> places;
  for (const auto& row : rows) places.insert(place_name(row, query.split_by));
  std::set<std::string> test(query.test.begin(), query.test.end());
  for (const auto& name : test) {
    if (!places.contains(name))
      return make_error(Errc::not_found, "there is no " + std::string(place_word(query.split_by)) +
                                             " named " + name + " among the rows");
  }
  if (test.empty() && query.test_share > 0) {
    std::vector<std::string> order(places.begin(), places.end());
    std::vector<std::uint32_t> index(order.size());
    for (std::uint32_t i = 0; i < index.size(); ++i) index[i] = i;
    ml::Random random{query.seed};
    random.shuffle(index);
    const auto n = static_cast<std::size_t>(std::ceil(query.test_share * static_cast<double>(order.size())));
    for (std::size_t i = 0; i < std::min(n, order.size()); ++i) test.insert(order[index[i]]);
  }
  for (auto& row : rows) row.test = test.contains(place_name(row, query.split_by));
  return boost::outcome_v2::success();
}

Result<std::vector<DatasetRow>> rows_of_campaigns(const DatasetQuery& query, CampaignStore& campaigns) {
  std::vector<DatasetRow> rows;
  for (const auto& id : query.campaigns) {
    BOOST_OUTCOME_TRY(const auto campaign, campaigns.campaign(id));
    CampaignStore::Filter filter;
    filter.campaign = id;
    filter.limit = 5000;
    filter.with_cir = true;
    while (true) {
      BOOST_OUTCOME_TRY(const auto page, campaigns.samples(filter));
      for (const auto& one : page) {
        if (!query.environments.empty() && std::find(query.environments.begin(), query.environments.end(),
                                                     one.truth.environment) == query.environments.end())
          continue;
        rows.push_back({campaign.name, one.truth.environment, one.truth.setting, false, one.truth.los,
                        one.truth.distance_m, 1, features_of(one.sample, one.truth)});
        if (rows.size() > k_most_rows)
          return make_error(Errc::invalid_argument, "more than 500000 measurements: ask for fewer campaigns");
      }
      if (page.size() < filter.limit) break;
      filter.after = page.back().id;
    }
  }
  return rows;
}

Result<void> add_rows_of_missions(const DatasetQuery& query, MeasurementStore& measurements,
                                  MissionStore& missions, std::vector<DatasetRow>& rows,
                                  std::map<std::string, std::size_t>& dropped) {
  for (const auto& id : query.missions) {
    BOOST_OUTCOME_TRY(const auto mission, missions.mission(id));
    MeasurementStore::Filter filter;
    filter.mission = id;
    filter.limit = 1000;
    filter.with_cir = true;
    do {
      BOOST_OUTCOME_TRY(const auto page, measurements.ranges(filter));
      for (const auto& range : page.rows) {
        if (!range.truth) {
          ++dropped["no label"];
          continue;
        }
        // Each anchor of a flight is a setting of its own; the place is the flight.
        rows.push_back({mission.name, mission.name, to_string(range.anchor), false, range.truth->los,
                        range.truth->distance_m, 1, features_of(range)});
        if (rows.size() > k_most_rows)
          return make_error(Errc::invalid_argument, "more than 500000 measurements: ask for fewer flights");
      }
      filter.after = page.next;
    } while (!filter.after.empty());
  }
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

/// Rows of the test part that stand in the training part too, number by number.
std::size_t copies(const DatasetTable& table) {
  const auto key = [](const DatasetRow& row) {
    std::vector<double> values;
    for (std::size_t f = 0; f < k_feature_count; ++f)
      if (row.features.present.test(f)) values.push_back(row.features.values[f]);
    values.push_back(row.true_range_m.value_or(-1));
    return values;
  };
  std::set<std::vector<double>> trained;
  for (const auto& row : table.rows)
    if (!row.test) trained.insert(key(row));
  return static_cast<std::size_t>(std::count_if(table.rows.begin(), table.rows.end(), [&](const auto& row) {
    return row.test && trained.contains(key(row));
  }));
}

}  // namespace

std::string split_report_json(const DatasetTable& table, Place split_by,
                              const std::map<std::string, std::size_t>& dropped) {
  Part train, test;
  for (const auto& row : table.rows) (row.test ? test : train).take(row);
  const auto environments = shared(train.environments, test.environments),
             campaigns = shared(train.campaigns, test.campaigns),
             settings = shared(train.settings, test.settings);
  const auto duplicates = copies(table);
  Ordered warnings = Ordered::array();
  if (test.rows == 0) warnings.push_back("no part is held out: figures come from cross-validation alone");
  if (!campaigns.empty())
    warnings.push_back("train and test have a campaign in common: the same radios, perhaps the same day");
  Ordered faults = Ordered::array();
  for (const auto& [reason, n] : dropped) faults.push_back({{"reason", reason}, {"count", n}});
  const bool leak = !environments.empty() || !settings.empty() || duplicates > 0;
  return Ordered{
      {"leak", leak},
      {"split_by", place_word(split_by)},
      {"train", train.json()},
      {"test", test.json()},
      {"shared", {{"environments", environments}, {"campaigns", campaigns}, {"settings", settings}}},
      {"duplicate_rows", duplicates},
      {"dropped", faults},
      {"warnings", warnings}}
      .dump(-1, ' ', false, Ordered::error_handler_t::replace);
}

DatasetQuery read_dataset_query(const Json& body, CampaignStore& campaigns, MissionStore& missions,
                                std::vector<FieldError>& errors) {
  DatasetQuery out;
  Fields fields(body, "", errors);
  out.name = fields.text("name", 200, true).value_or("");
  std::vector<std::string> names, flights;
  if (const Json* list = fields.child("campaigns")) read_names(*list, "/campaigns", names, errors);
  if (const Json* list = fields.child("missions")) read_names(*list, "/missions", flights, errors);
  if (const Json* list = fields.child("environments"))
    read_names(*list, "/environments", out.environments, errors);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto id = parse_uuid(names[i]);
    const auto found = id ? campaigns.campaign(CampaignId{id.value()}) : campaigns.campaign(names[i]);
    if (found)
      out.campaigns.push_back(found.value().id);
    else
      errors.push_back({"/campaigns/" + std::to_string(i), "unknown_campaign", "there is no such campaign"});
  }
  for (std::size_t i = 0; i < flights.size(); ++i) {
    const auto id = parse_uuid(flights[i]);
    if (id && missions.mission(MissionId{id.value()}))
      out.missions.push_back(MissionId{id.value()});
    else
      errors.push_back({"/missions/" + std::to_string(i), "unknown_mission", "there is no such mission"});
  }
  if (out.campaigns.empty() && out.missions.empty() && errors.empty())
    errors.push_back({"/campaigns", "required", "name campaigns or missions"});
  if (const auto word = fields.word("aggregation", {"none", "mean", "median"}))
    out.aggregation = static_cast<Aggregation>(*word);
  out.filter_faults = fields.boolean("filter_faults").value_or(true);
  if (const Json* part = fields.child("split")) {
    Fields inner(*part, "/split", errors);
    if (const auto word = inner.word("by", {"environment", "campaign"}))
      out.split_by = static_cast<Place>(*word);
    if (const Json* list = inner.child("test")) read_names(*list, "/split/test", out.test, errors);
    out.test_share = inner.number("test_share", 0, 0.9).value_or(0);
    out.seed = static_cast<std::uint64_t>(inner.integer("seed", 0, 1'000'000'000).value_or(1));
    inner.finish();
  }
  fields.finish();
  out.json = body.is_object() ? body.dump() : "{}";
  return out;
}

Result<FrozenDataset> freeze(const DatasetQuery& query, CampaignStore& campaigns,
                             MeasurementStore& measurements, MissionStore& missions) {
  std::map<std::string, std::size_t> dropped;
  BOOST_OUTCOME_TRY(auto rows, rows_of_campaigns(query, campaigns));
  BOOST_OUTCOME_TRYV(add_rows_of_missions(query, measurements, missions, rows, dropped));
  const auto impossible =
      std::remove_if(rows.begin(), rows.end(), [](const DatasetRow& row) { return !(row.range_m() > 0); });
  if (impossible != rows.end())
    dropped["zero range"] += static_cast<std::size_t>(std::distance(impossible, rows.end()));
  rows.erase(impossible, rows.end());
  if (query.filter_faults) rows = without_outliers(std::move(rows), dropped);
  if (query.aggregation != Aggregation::none) rows = aggregated(rows, query.aggregation);
  if (rows.empty()) return make_error(Errc::too_few_observations, "no labelled measurement matches");
  BOOST_OUTCOME_TRYV(split(query, rows));
  FrozenDataset out;
  out.table.rows = std::move(rows);
  for (const auto& row : out.table.rows) ++(row.test ? out.n_test : out.n_train);
  if (out.n_train == 0)
    return make_error(Errc::too_few_observations, "every place is held out: nothing is left to train on");
  out.report_json = split_report_json(out.table, query.split_by, dropped);
  return out;
}

}  // namespace anchord::api
