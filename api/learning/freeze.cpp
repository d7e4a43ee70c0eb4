#include "api/learning/freeze.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/learning/range_features.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/exclusion_store.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

/// A setting is one radio at one place: too small to hold out.
constexpr std::array<std::string_view, 2> k_split_by{k_place_words.word(Place::environment),
                                                     k_place_words.word(Place::campaign)};
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

/// Registers a sample may have, by their names in register_columns() and in their order.
const std::vector<std::string> k_registers{"fp_amp1",   "fp_amp2",   "fp_amp3", "cir_pwr",
                                           "std_noise", "max_noise", "rxpacc"};

std::vector<double> registers_of(const CampaignSample& x) {
  std::vector<double> out;
  for (const auto& value :
       {x.fp_amp1, x.fp_amp2, x.fp_amp3, x.cir_power, x.std_noise, x.max_noise, x.preamble_count})
    out.push_back(value.value_or(std::numeric_limits<double>::quiet_NaN()));
  return out;
}

std::vector<double> registers_of(const Range& range) {
  CampaignSample x;
  x.std_noise = range.std_noise;
  return registers_of(x);
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
                        one.truth.distance_m, 1, features_of(one.sample, one.truth), registers_of(one.sample),
                        one.truth.truth_sigma_m ? one.truth.truth_sigma_m : campaign.truth_sigma_m});
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
                                  MissionStore& missions, ExclusionStore& exclusions,
                                  std::vector<DatasetRow>& rows,
                                  std::map<std::string, std::size_t>& dropped) {
  std::map<std::string, std::size_t> of_name;
  for (const auto& id : query.missions) {
    BOOST_OUTCOME_TRY(const auto mission, missions.mission(id));
    ++of_name[mission.name];
  }
  for (const auto& id : query.missions) {
    BOOST_OUTCOME_TRY(const auto mission, missions.mission(id));
    // Two flights of one name are two places.
    const std::string flight =
        of_name[mission.name] > 1 ? mission.name + " (" + to_string(id) + ")" : mission.name;
    BOOST_OUTCOME_TRY(const auto out_of_use, exclusions.exclusions(id));
    MeasurementStore::Filter filter;
    filter.mission = id;
    filter.limit = 1000;
    filter.with_cir = true;
    do {
      BOOST_OUTCOME_TRY(const auto page, measurements.ranges(filter));
      for (const auto& range : page.rows) {
        if (excluded(out_of_use, range)) {
          ++dropped["excluded"];
          continue;
        }
        if (!range.truth) {
          ++dropped["no label"];
          continue;
        }
        // Each anchor of a flight is a setting of its own; the place is the flight.
        rows.push_back({flight, flight, to_string(range.anchor), false, range.truth->los,
                        range.truth->distance_m, 1, features_of(range), registers_of(range)});
        if (rows.size() > k_most_rows)
          return make_error(Errc::invalid_argument, "more than 500000 measurements: ask for fewer flights");
      }
      filter.after = page.next;
    } while (!filter.after.empty());
  }
  return boost::outcome_v2::success();
}

}  // namespace

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
    errors.push_back({"/campaigns", "required", "give campaigns or missions"});
  if (const auto how = fields.word("aggregation", k_aggregation_words)) out.how.aggregation = *how;
  out.how.filter_faults = fields.boolean("filter_faults").value_or(true);
  if (const Json* part = fields.child("split")) {
    Fields inner(*part, "/split", errors);
    if (const auto by = inner.word("by", k_split_by))
      out.how.split_by = place_of(*by).value_or(out.how.split_by);
    if (const Json* list = inner.child("test")) read_names(*list, "/split/test", out.how.test, errors);
    out.how.test_share = inner.number("test_share", 0, 0.9).value_or(0);
    out.how.seed = static_cast<std::uint64_t>(inner.integer("seed", 0, 1'000'000'000).value_or(1));
    inner.finish();
  }
  fields.finish();
  out.json = body.is_object() ? to_wire(body) : "{}";
  return out;
}

Result<FrozenDataset> freeze(const DatasetQuery& query, CampaignStore& campaigns,
                             MeasurementStore& measurements, MissionStore& missions,
                             ExclusionStore& exclusions) {
  std::map<std::string, std::size_t> dropped;
  BOOST_OUTCOME_TRY(auto rows, rows_of_campaigns(query, campaigns));
  BOOST_OUTCOME_TRYV(add_rows_of_missions(query, measurements, missions, exclusions, rows, dropped));
  const auto impossible =
      std::remove_if(rows.begin(), rows.end(), [](const DatasetRow& row) { return !(row.range_m() > 0); });
  if (impossible != rows.end())
    dropped["zero range"] += static_cast<std::size_t>(std::distance(impossible, rows.end()));
  rows.erase(impossible, rows.end());
  return freeze_rows({std::move(rows), k_registers}, query.how, std::move(dropped));
}

}  // namespace anchord::api
